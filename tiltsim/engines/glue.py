"""LLVM text around traced programs: MuJoCo's control callback, and loops over steps and rows.

The text is a template: words in ``<...>`` are numbers that are known when it is compiled.
"""

from __future__ import annotations

import struct
from typing import Final

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
  call void @controls(ptr %header, ptr %qpos, ptr %qvel, ptr %act, ptr %ctrl, ptr %user, ptr %ctrl)
  br label %controlled
held:
  call void @hold(ptr %header, ptr %qpos, ptr %qvel, ptr %act, ptr %ctrl, ptr %user, ptr %ctrl)
  br label %controlled
controlled:
  %recorder_at = getelementptr double, ptr %header, i64 <recorder>
  %address = load double, ptr %recorder_at
  %records = fcmp une double %address, 0.0
  br i1 %records, label %record, label %count_on
record:
  %place = fptoui double %address to i64
  %recorder = inttoptr i64 %place to ptr
  %left = load double, ptr %recorder
  %less = fsub double %left, 1.0
  store double %less, ptr %recorder
  %now = fcmp oeq double %left, 0.0
  br i1 %now, label %sample, label %recorded
sample:
  %row = call ptr @next_row(ptr %recorder)
  %full = icmp eq ptr %row, null
  br i1 %full, label %recorded, label %take
take:
  call void @sample(ptr %header, ptr %qpos, ptr %qvel, ptr %act, ptr %ctrl, ptr %user,
                    ptr %recorder, ptr %row)
  call void @took(ptr %recorder, ptr %row)
  br label %recorded
recorded:
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
"""
"""The control callback: it evaluates the control step and, if it is due, takes a sample.

Once a recording is over, the controls are NaN: MuJoCo warns of them and a batch stops there.
"""

RECORDER: Final = """
define internal ptr @next_row(ptr %recorder) nounwind {
  %over = call i1 @is_over(ptr %recorder)
  %taken_at = getelementptr double, ptr %recorder, i64 3
  %taken = load double, ptr %taken_at
  %rows = fptosi double %taken to i64
  %numbers = mul i64 %rows, <width>
  %first = add i64 %numbers, <rows_at>
  %place = getelementptr double, ptr %recorder, i64 %first
  %row = select i1 %over, ptr null, ptr %place
  ret ptr %row
}
define internal void @took(ptr %recorder, ptr %row) nounwind {
  %ends_at = getelementptr double, ptr %row, i64 <width>
  %ends = load double, ptr %ends_at
  %terminated_at = getelementptr double, ptr %recorder, i64 5
  store double %ends, ptr %terminated_at
  %taken_at = getelementptr double, ptr %recorder, i64 3
  %taken = load double, ptr %taken_at
  %more = fadd double %taken, 1.0
  store double %more, ptr %taken_at
  %capacity_at = getelementptr double, ptr %recorder, i64 4
  %capacity = load double, ptr %capacity_at
  %later = fadd double %taken, 2.0
  %regular = fcmp olt double %later, %capacity
  %interval_at = getelementptr double, ptr %recorder, i64 1
  %interval = load double, ptr %interval_at
  %last_at = getelementptr double, ptr %recorder, i64 2
  %last = load double, ptr %last_at
  %next = select i1 %regular, double %interval, double %last
  %left = fsub double %next, 1.0
  store double %left, ptr %recorder
  ret void
}
define internal i1 @is_over(ptr %recorder) nounwind {
  %taken_at = getelementptr double, ptr %recorder, i64 3
  %taken = load double, ptr %taken_at
  %capacity_at = getelementptr double, ptr %recorder, i64 4
  %capacity = load double, ptr %capacity_at
  %full = fcmp oeq double %taken, %capacity
  %terminated_at = getelementptr double, ptr %recorder, i64 5
  %terminated = load double, ptr %terminated_at
  %ended = fcmp une double %terminated, 0.0
  %over = or i1 %full, %ended
  ret i1 %over
}
"""
"""Access to the memory of a `tiltsim.engines.recorder.Recorder`."""

STEPPER: Final = """
define void @advance(i64 %samples, i64 %steps, i64 %every, ptr %index, ptr %now, ptr %settings,
                     ptr %user, ptr %recorder) nounwind {
entry:
  %records = icmp ne ptr %recorder, null
  %begin = load double, ptr %index
  %begun = fptosi double %begin to i64
  br label %interval
interval:
  %taken = phi i64 [0, %entry], [%taken_on, %recorded]
  %first = phi i64 [%begun, %entry], [%end, %recorded]
  %end = add i64 %first, %steps
  br label %step
step:
  %at = phi i64 [%first, %interval], [%on, %stepped]
  %rest = srem i64 %at, %every
  %due = icmp eq i64 %rest, 0
  br i1 %due, label %sampling, label %holding
sampling:
  call void @step_sampled(ptr %index, ptr %now, ptr %settings, ptr %user, ptr %now)
  br label %stepped
holding:
  call void @<step_held>(ptr %index, ptr %now, ptr %settings, ptr %user, ptr %now)
  br label %stepped
stepped:
  %on = add i64 %at, 1
  %count = sitofp i64 %on to double
  store double %count, ptr %index
  %again = icmp slt i64 %on, %end
  br i1 %again, label %step, label %stop
stop:
  br i1 %records, label %record, label %recorded
record:
  %row = call ptr @next_row(ptr %recorder)
  %end_rest = srem i64 %end, %every
  %fresh = icmp eq i64 %end_rest, 0
  br i1 %fresh, label %sample_fresh, label %sample_stale
sample_fresh:
  call void @sample_sampled(ptr %index, ptr %now, ptr %settings, ptr %user, ptr %recorder, ptr %row)
  br label %took
sample_stale:
  call void @<sample_held>(ptr %index, ptr %now, ptr %settings, ptr %user, ptr %recorder, ptr %row)
  br label %took
took:
  call void @took(ptr %recorder, ptr %row)
  %over = call i1 @is_over(ptr %recorder)
  br i1 %over, label %exit, label %recorded
recorded:
  %taken_on = add i64 %taken, 1
  %more = icmp slt i64 %taken_on, %samples
  br i1 %more, label %interval, label %exit
exit:
  ret void
}
"""
"""Steps of the equations of motion, and a sample after every interval of them."""

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


def filled(template: str, **words: float | str) -> str:
    """A template with its words replaced; floats are written bit by bit."""
    for name, value in words.items():
        if isinstance(value, float):
            (bits,) = struct.unpack("Q", struct.pack("d", value))
            value = f"0x{bits:016X}"
        template = template.replace(f"<{name}>", str(value))
    return template
