"""LLVM text around traced programs: MuJoCo's control callback, and loops over steps and rows.

The text is a template: words in ``<...>`` are numbers that are known when it is compiled.
"""

from typing import Final

from tiltsim.engines.base import Vectors
from tiltsim.engines.programs import HEAD_SIZE, SIDES, RecorderHead
from tiltsim_controllers.code.lanes import Lanes

CALLBACK: Final = """
define void @callback(ptr %model, ptr %data) nounwind {
entry:
  %size_at = getelementptr i8, ptr %model, i64 <model_userdata_size>
  %size = load i32, ptr %size_at
  %large = icmp sge i32 %size, <head>
  br i1 %large, label %check, label %exit
check:
  %user_at = getelementptr i8, ptr %data, i64 <userdata>
  %header = load ptr, ptr %user_at
  %user = getelementptr double, ptr %header, i64 <header_size>
  %sign = load double, ptr %user
  %ours = fcmp oeq double %sign, <signature>
  br i1 %ours, label %fly, label %exit
fly:
  %qpos_at = getelementptr i8, ptr %data, i64 <qpos>
  %qpos = load ptr, ptr %qpos_at
  %qvel_at = getelementptr i8, ptr %data, i64 <qvel>
  %qvel = load ptr, ptr %qvel_at
  %others = getelementptr double, ptr %qpos, i64 <vehicle_size>
  %history_at = getelementptr i8, ptr %data, i64 <history>
  %history = load ptr, ptr %history_at
  %act_at = getelementptr i8, ptr %data, i64 <act>
  %act = load ptr, ptr %act_at
  %ctrl_at = getelementptr i8, ptr %data, i64 <ctrl>
  %ctrl = load ptr, ptr %ctrl_at
  %count_at = getelementptr double, ptr %header, i64 <evaluations>
  %count = load double, ptr %count_at
  %period_at = getelementptr double, ptr %header, i64 <control_period>
  %period = load double, ptr %period_at
  %continuous = fcmp oeq double %period, 0.0
  %rest = frem double %count, %period
  %due = fcmp oeq double %rest, 0.0
  %samples = or i1 %continuous, %due
  br i1 %samples, label %sampled, label %held
sampled:
  call void @controls(<state>, ptr %ctrl)
  br label %controlled
held:
  call void @hold(<state>, ptr %ctrl)
  br label %controlled
controlled:
  %recorder_at = getelementptr double, ptr %header, i64 <recorder>
  %address = load double, ptr %recorder_at
  %records = fcmp une double %address, 0.0
  br i1 %records, label %record, label %count_on
record:
  %place = fptoui double %address to i64
  %recorder = inttoptr i64 %place to ptr
  %left = call double @entry(ptr %recorder, i64 <left>)
  %now = fcmp oeq double %left, 0.0
  br i1 %now, label %sample, label %recorded
sample:
  %finished = call i1 @is_over(ptr %recorder)
  br i1 %finished, label %recorded, label %take
take:
  %taken = call double @entry(ptr %recorder, i64 <samples>)
  %row_number = fptosi double %taken to i64
  %numbers = mul i64 %row_number, <width>
  %first = add i64 %numbers, <rows_at>
  %row = getelementptr double, ptr %recorder, i64 %first
  call void @sample(<state>, ptr %recorder, ptr %row)
  %ends_at = getelementptr double, ptr %row, i64 <width>
  %ends = load double, ptr %ends_at
  call void @took(ptr %recorder, i1 true, double %ends)
  br label %recorded
recorded:
  call void @count_down(ptr %recorder)
  %over = call i1 @is_over(ptr %recorder)
  br i1 %over, label %stop, label %count_on
stop:
  %index = phi i64 [0, %recorded], [%next, %stop]
  %entry_at = getelementptr double, ptr %ctrl, i64 %index
  store double <nan>, ptr %entry_at
  %next = add i64 %index, 1
  %more = icmp slt i64 %next, <controls>
  br i1 %more, label %stop, label %count_on
count_on:
  %counted = fadd double %count, 1.0
  store double %counted, ptr %count_at
  br label %exit
exit:
  ret void
}
""".replace("<state>", "ptr %" + ", ptr %".join(("header", *Vectors._fields, "ctrl", "user")))
"""The control callback: it evaluates the control step and, if it is due, takes a sample.

Once a recording is over, the controls are NaN: MuJoCo warns of them and a batch stops there.
"""

RECORDER: Final = """
define internal <D> @entry(ptr %recorder, i64 %index) alwaysinline nounwind {
  %place = getelementptr <D>, ptr %recorder, i64 %index
  %value = load <D>, ptr %place, align 8
  ret <D> %value
}
define internal void @set(ptr %recorder, i64 %index, <B> %where, <D> %value) alwaysinline nounwind {
  %place = getelementptr <D>, ptr %recorder, i64 %index
  %before = load <D>, ptr %place, align 8
  %now = select <B> %where, <D> %value, <D> %before
  store <D> %now, ptr %place, align 8
  ret void
}
define internal <B> @is_over(ptr %recorder) nounwind {
  %taken = call <D> @entry(ptr %recorder, i64 <samples>)
  %capacity = call <D> @entry(ptr %recorder, i64 <capacity>)
  %full = fcmp oeq <D> %taken, %capacity
  %terminated = call <D> @entry(ptr %recorder, i64 <terminated>)
  %ended = fcmp une <D> %terminated, zeroinitializer
  %over = or <B> %full, %ended
  ret <B> %over
}
define internal void @took(ptr %recorder, <B> %where, <D> %ends) nounwind {
  call void @set(ptr %recorder, i64 <terminated>, <B> %where, <D> %ends)
  %taken = call <D> @entry(ptr %recorder, i64 <samples>)
  %more = fadd <D> %taken, <0x3FF0000000000000>
  call void @set(ptr %recorder, i64 <samples>, <B> %where, <D> %more)
  %later = fadd <D> %more, <0x3FF0000000000000>
  %capacity = call <D> @entry(ptr %recorder, i64 <capacity>)
  %regular = fcmp olt <D> %later, %capacity
  %interval = call <D> @entry(ptr %recorder, i64 <interval>)
  %last = call <D> @entry(ptr %recorder, i64 <last_interval>)
  %next = select <B> %regular, <D> %interval, <D> %last
  call void @set(ptr %recorder, i64 <left>, <B> %where, <D> %next)
  ret void
}
define internal void @count_down(ptr %recorder) nounwind {
  %left = call <D> @entry(ptr %recorder, i64 <left>)
  %less = fsub <D> %left, <0x3FF0000000000000>
  call void @set(ptr %recorder, i64 <left>, <B> <1b>, <D> %less)
  ret void
}
"""
"""Access to the head of a `tiltsim.engines.programs.Recorder`, or of one per lane."""

CHOOSE: Final = """
define internal void @choose(i64 %size, <B> %where, ptr %yes, ptr %no, ptr %out) nounwind {
entry:
  br label %entry_of
entry_of:
  %index = phi i64 [0, %entry], [%next, %entry_of]
  %yes_at = getelementptr <D>, ptr %yes, i64 %index
  %no_at = getelementptr <D>, ptr %no, i64 %index
  %one = load <D>, ptr %yes_at, align 8
  %other = load <D>, ptr %no_at, align 8
  %chosen = select <B> %where, <D> %one, <D> %other
  %out_at = getelementptr <D>, ptr %out, i64 %index
  store <D> %chosen, ptr %out_at, align 8
  %next = add i64 %index, 1
  %more = icmp slt i64 %next, %size
  br i1 %more, label %entry_of, label %exit
exit:
  ret void
}
"""
"""Entries of one of two vectors, lane by lane."""

CONTINUOUS: Final = """
define internal void @<name>(ptr %index, ptr %every, <vectors>, ptr %out) alwaysinline nounwind {
  call void @<name>_sampled(ptr %index, <vectors>, ptr %out)
  ret void
}
"""
"""A program of a controller that is evaluated at every stage of a step."""

HELD: Final = """
define internal void @<name>(ptr %index, ptr %every, <vectors>, ptr %out) nounwind {
entry:
  %spare = alloca <D>, i64 <size>, align 8
  %at = load <D>, ptr %index, align 8
  %period = load <D>, ptr %every, align 8
  %periods = fdiv <D> %at, %period
  %whole = call <D> @llvm.floor.<f64>(<D> %periods)
  %begin = fmul <D> %whole, %period
  %samples = fcmp oeq <D> %begin, %at
  %holds = xor <B> %samples, <1b>
  %any_samples = call i1 @any(<B> %samples)
  %any_holds = call i1 @any(<B> %holds)
  br i1 %any_samples, label %sampling, label %sampled
sampling:
  call void @<name>_sampled(ptr %index, <vectors>, ptr %out)
  br label %sampled
sampled:
  br i1 %any_holds, label %holding, label %exit
holding:
  %place = select i1 %any_samples, ptr %spare, ptr %out
  call void @<name>_held(ptr %index, <vectors>, ptr %place)
  br i1 %any_samples, label %join, label %exit
join:
  call void @choose(i64 <size>, <B> %samples, ptr %out, ptr %spare, ptr %out)
  br label %exit
exit:
  ret void
}
"""
"""A program of a held controller: at its samples, between them, or some lanes of each."""

STEPPER: Final = """
define void @advance(i64 %steps, i64 %returns, ptr %index, ptr %every, ptr %now, ptr %other,
                     ptr %settings, ptr %user, ptr %recorder, ptr %rows, ptr %saved) nounwind {
entry:
  %row = alloca <D>, i64 <row_size>, align 8
  %early = icmp ne i64 %returns, 0
  br label %turn
turn:
  %taken = phi i64 [0, %entry], [%on, %stepped]
  %state = phi ptr [%now, %entry], [%next, %stepped]
  %next = phi ptr [%other, %entry], [%state, %stepped]
  %was_over = call <B> @is_over(ptr %recorder)
  %left = call <D> @entry(ptr %recorder, i64 <left>)
  %at_sample = fcmp oeq <D> %left, zeroinitializer
  %flies = xor <B> %was_over, <1b>
  %due = and <B> %at_sample, %flies
  %any_due = call i1 @any(<B> %due)
  br i1 %any_due, label %record, label %check
record:
  call void @sample(ptr %index, ptr %every, ptr %state, ptr %settings, ptr %user, ptr %recorder,
                    ptr %row)
  call void @keep(<B> %due, ptr %row, ptr %recorder, ptr %rows)
  %ended = call <B> @is_terminated(ptr %recorder)
  %sound = xor <B> %ended, <1b>
  %good = and <B> %due, %sound
  %saved_state = getelementptr <D>, ptr %saved, i64 1
  call void @choose(i64 1, <B> %good, ptr %index, ptr %saved, ptr %saved)
  call void @choose(i64 <size>, <B> %good, ptr %state, ptr %saved_state, ptr %saved_state)
  br label %check
check:
  %over = call <B> @is_over(ptr %recorder)
  %active = xor <B> %over, <1b>
  %any_active = call i1 @any(<B> %active)
  %any_over = call i1 @any(<B> %over)
  %returns_now = and i1 %early, %any_over
  %more = icmp slt i64 %taken, %steps
  %waits = xor i1 %returns_now, true
  %goes_on = and i1 %more, %waits
  %steps_on = and i1 %goes_on, %any_active
  br i1 %steps_on, label %step, label %exit
step:
  call void @step(ptr %index, ptr %every, ptr %state, ptr %settings, ptr %user, ptr %next)
  br i1 %any_over, label %rest, label %stepped
rest:
  call void @choose(i64 <size>, <B> %active, ptr %next, ptr %state, ptr %next)
  br label %stepped
stepped:
  %count = load <D>, ptr %index, align 8
  %counted = fadd <D> %count, <0x3FF0000000000000>
  call void @set(ptr %index, i64 0, <B> %active, <D> %counted)
  call void @count_down(ptr %recorder)
  %on = add i64 %taken, 1
  br label %turn
exit:
  call void @choose(i64 <size>, <B> <1b>, ptr %state, ptr %now, ptr %now)
  ret void
}
define internal <B> @is_terminated(ptr %recorder) nounwind {
  %terminated = call <D> @entry(ptr %recorder, i64 <terminated>)
  %ended = fcmp une <D> %terminated, zeroinitializer
  ret <B> %ended
}
define internal void @keep(<B> %due, ptr %row, ptr %recorder, ptr %rows) nounwind {
entry:
  %due_lanes = alloca <D>, align 8
  %flags = uitofp <B> %due to <D>
  store <D> %flags, ptr %due_lanes, align 8
  br label %lane
lane:
  %number = phi i64 [0, %entry], [%next, %lane_done]
  %flag_at = getelementptr double, ptr %due_lanes, i64 %number
  %flag = load double, ptr %flag_at
  %wants = fcmp une double %flag, 0.0
  br i1 %wants, label %copies, label %lane_done
copies:
  %head = getelementptr <D>, ptr %recorder, i64 <samples>
  %taken_at = getelementptr double, ptr %head, i64 %number
  %taken = load double, ptr %taken_at
  %row_number = fptosi double %taken to i64
  %first = mul i64 %row_number, <width>
  %own_at = getelementptr ptr, ptr %rows, i64 %number
  %own = load ptr, ptr %own_at
  %target = getelementptr double, ptr %own, i64 %first
  br label %field
field:
  %index = phi i64 [0, %copies], [%further, %field]
  %from_vector = getelementptr <D>, ptr %row, i64 %index
  %from = getelementptr double, ptr %from_vector, i64 %number
  %value = load double, ptr %from
  %to = getelementptr double, ptr %target, i64 %index
  store double %value, ptr %to
  %further = add i64 %index, 1
  %unfinished = icmp slt i64 %further, <width>
  br i1 %unfinished, label %field, label %lane_done
lane_done:
  %next = add i64 %number, 1
  %more = icmp slt i64 %next, <lanes>
  br i1 %more, label %lane, label %exit
exit:
  %ends_at = getelementptr <D>, ptr %row, i64 <width>
  %ends = load <D>, ptr %ends_at, align 8
  call void @took(ptr %recorder, <B> %due, <D> %ends)
  %sides = getelementptr <D>, ptr %recorder, i64 <head_size>
  %new_sides = getelementptr <D>, ptr %ends_at, i64 1
  call void @choose(i64 <checks>, <B> %due, ptr %new_sides, ptr %sides, ptr %sides)
  ret void
}
"""
"""Steps of the equations of motion, and samples of the lanes that are due for one.

A lane whose recording is over stays at rest; the function returns after some steps, once all lanes
are over, or, if requested, once any is. It also keeps index and state of the last good sample.
"""

ROWS: Final = """
define void @rows(i64 %count, ptr %time, ptr %states, ptr %user, ptr %values) nounwind {
entry:
  br label %row
row:
  %index = phi i64 [0, %entry], [%next, %row]
  %time_at = getelementptr double, ptr %time, i64 %index
  %state = mul i64 %index, <state>
  %state_at = getelementptr double, ptr %states, i64 %state
  %value = mul i64 %index, <width>
  %value_at = getelementptr double, ptr %values, i64 %value
  call void @row(ptr %time_at, ptr %state_at, ptr %user, ptr %value_at)
  %next = add i64 %index, 1
  %more = icmp slt i64 %next, %count
  br i1 %more, label %row, label %exit
exit:
  ret void
}
"""
"""A program over the samples of a flight."""

EMPTY: Final = """
define void @empty(ptr %model, ptr %data) nounwind {
  ret void
}
define double @clock() nounwind {
  ret double 0.0
}
"""
"""A callback that does nothing, and a clock for MuJoCo's timers that always reads zero."""


_PLACES: Final = {name: place for place, name in enumerate(RecorderHead._fields)} | {
    "head_size": HEAD_SIZE,
    "rows_at": HEAD_SIZE + SIDES,
}


def filled(template: str, lanes: int = 1, **words: float | str) -> str:
    """A template with its words replaced; floats are written bit by bit.

    Args:
        template: Also has placeholders of `tiltsim_controllers.code.lanes.Lanes.filled`, and the
            places of the entries of a recorder's head by name.
        lanes: Number of lanes.
        words: By name.
    """
    template = Lanes(lanes).filled(template)
    for name, value in {**words, **_PLACES}.items():
        text = Lanes().constant(value) if isinstance(value, float) else str(value)
        template = template.replace(f"<{name}>", text)
    return template


def stepper_text(held: bool, lanes: int, size: int, width: int, checks: int) -> str:
    """The text of `STEPPER` and of all that it calls but the programs.

    Args:
        held: Whether the controller is sampled and held.
        lanes: Number of lanes.
        size: Number of states and inputs in force.
        width: Number of the fields of a sample.
        checks: Number of sign checks.
    """
    pointers = "ptr %now, ptr %settings, ptr %user"
    row_size = width + 1 + checks
    template = HELD if held else CONTINUOUS
    parts = [
        template.replace("<name>", "step").replace("<size>", str(size)),
        template.replace("<name>", "sample").replace("<size>", str(row_size)),
    ]
    calls = [parts[0].replace("<vectors>", pointers)]
    calls.append(parts[1].replace("<vectors>", f"{pointers}, ptr %recorder"))
    text = "".join([CHOOSE, RECORDER, *calls, STEPPER])
    return filled(text, lanes, size=size, width=width, checks=checks, row_size=row_size)
