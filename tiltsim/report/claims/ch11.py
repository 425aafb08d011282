"""Chapter 11: the penguin swing, its saturation, and the bound on the Lyapunov candidate."""

from __future__ import annotations

from math import pi
from typing import Final

from tiltsim.report import penguin_proof as proof
from tiltsim.report.claim import AnalysisClaim, FlightClaim
from tiltsim.report.statement import Statement

_LARGE: Final = "ch11_penguin/straight_line#large"

CAN_PUSH = Statement(
    id="ch11-zero-acceleration",
    source="ch. 11, Sec. 3, Figs. 5-8",
    text="The thrusts can keep the acceleration along y at zero",
    thesis="The small swing brings “the possibility of maintaining 0 acceleration along Y-axis. "
    "When changing yaw is large …, it is impossible.”",
    criterion="The direction of the reference lies between the two thrusts",
)
SWITCH_LINE = Statement(
    id="ch11-switch-line",
    source="ch. 11, Sec. 6, Prop. 4",
    text="K_Y1 e_y' + K_Y2 e_y where a rotor stops, printed as 1/√3",
    thesis="Eqs. (34), (35): S_11 where K_Y1 e_y' + K_Y2 e_y is beyond ∓1/√3.",
    criterion="The value at which the desired acceleration leaves the sector between the thrusts "
    "rounds to 0.57735",
)
LEMMA_1 = Statement(
    id="ch11-lemma-1",
    source="ch. 11, Sec. 6, Lemma 1, Eqs. (21)-(24)",
    text="The law with the switch matrix is the law with the limit",
    thesis="“The practical control rule described in (12), (13) is equivalent to Equation (21).”",
    criterion="Both give the same squares at 200 random states, bit for bit",
)
LEMMA_2 = Statement(
    id="ch11-lemma-2",
    source="ch. 11, Sec. 6, Lemma 2, Eq. (27)",
    text="The switch matrix depends on the acceleration in the vehicle's axes alone",
    thesis="“S_pq is determined based on (m, n)”, by Eq. (27).",
    criterion="Eq. (27) gives the squares of Eq. (12) at 200 random (m, n)",
)
EQ_42 = Statement(
    id="ch11-eq-42",
    source="ch. 11, Sec. 6, Lemma 5, Eq. (42)",
    text="The printed solution with both rotors pushing is correct",
    thesis="Eq. (42) prints e_y and e_y' as sums of e^-3t and e^-6t.",
    criterion="It equals the solution of Eq. (41) after 0.3 s, from every state of a grid in the "
    "zone of Eq. (39)",
)
EQ_43 = Statement(
    id="ch11-eq-43",
    source="ch. 11, Sec. 6, Lemma 5, Eq. (43)",
    text="Eq. (43) holds when a rotor stops",
    thesis="“Substituting Equation (42) into Equation (40) yields Equation (43).”",
    criterion="Its left side is zero at the time found by bisection, from every state of a grid "
    "in the zone of Eq. (39)",
)
TIME = Statement(
    id="ch11-printed-times",
    source="ch. 11, Sec. 6, Lemmas 5 and 6, Eqs. (44), (47)",
    text="The printed time after which a rotor stops is correct",
    thesis="Eqs. (44) and (47) print e^3t in closed form.",
    criterion="It equals the time found by bisection to 1e-9 s, from every state of a grid in the "
    "zone",
)
WITHIN = Statement(
    id="ch11-stops-within-1-s",
    source="ch. 11, Sec. 6, Lemmas 5 and 6",
    text="From the zone of Eq. (39) a rotor stops within 0 < t < 1 s",
    thesis="“… the state P(e_y, e_y') will reach the bound specified in Equation (40) at t₁. "
    "Further, 0 < t₁ < 1.”",
    criterion="It does from every state of a grid in the zone",
)
MIRROR = Statement(
    id="ch11-mirror-zone",
    source="ch. 11, Sec. 6, Lemmas 7 and 8, Prop. 5",
    text="Half a period leads from the zone into its mirror image",
    thesis="“… then the state will arrive at a state satisfying the conditions in (45) after half "
    "period (1 second).”",
    criterion="It does from every state of a grid in the zone of Eq. (39)",
)
FIRST = Statement(
    id="ch11-first-half",
    source="ch. 11, Sec. 6, Remark 8",
    text="The first half period, from rest, ends in the zone",
    thesis="“The state P(e_y, e_y') is within space defined by (39) at T/2.”",
    criterion="The state after 1 s of one rotor pushing from rest satisfies Eq. (39)",
)
SLOPE = Statement(
    id="ch11-printed-slopes",
    source="ch. 11, Sec. 6, Prop. 6, Eqs. (61), (67)",
    text="The printed derivative of the Lyapunov candidate is correct",
    thesis="Eqs. (61) and (67) print it as a product of a line and a parabola in t.",
    criterion="It equals the difference quotient of the candidate to 1e-6 at 123 states",
)
EQ_66 = Statement(
    id="ch11-eq-66",
    source="ch. 11, Sec. 6, Prop. 6, Eq. (66)",
    text="Eq. (66) holds on the bound of Eq. (40)",
    thesis="“Substituting (65) into (40) yields” ë_m + 2 e_m = 1/(9√3).",
    criterion="The printed sum equals the printed constant along the bound",
)
ENDS = Statement(
    id="ch11-largest-at-ends",
    source="ch. 11, Sec. 6, Prop. 6",
    text="In between, the Lyapunov candidate does not exceed its values at half periods",
    thesis="Eq. (56): 𝓛(t) ≤ max{𝓛(nT/2), 𝓛((n+1)T/2)}.",
    criterion="It does not on 101 points of the motion from every state of a grid in the zone",
)
GROWTH = Statement(
    id="ch11-growth",
    source="ch. 11, Sec. 6, Remark 10, Eq. (71)",
    text="The candidate's largest growth over half a period",
    thesis="“Calculating the maximum of ΔL(n), we receive the same result on either bound. That "
    "is” ΔL(n) ≤ 3/4.",
    criterion="The largest growth on the bound of the zone rounds to 0.75",
)
NOWHERE_MORE = Statement(
    id="ch11-growth-in-zone",
    source="ch. 11, Sec. 6, Remark 10",
    text="The candidate grows by more than 3/4 nowhere in the zone",
    thesis="“… the maximum value of ΔL(n) is either on the bound defined in (40) or on the bound "
    "defined in (46).”",
    criterion="It grows by at most 3/4 from every state of a grid in the zone",
)
EQ_72 = Statement(
    id="ch11-eq-72",
    source="ch. 11, Sec. 6, Main Proof, Eq. (72)",
    text="Where ΔL is negative, Eq. (72) holds",
    thesis="“ΔL(i) < 0. Thus, we have” (e_y, e_y')|iT/2 < (e_y, e_y')|(i+1)T/2.",
    criterion="The candidate is larger at the next half period than before, at every such state of "
    "the grid",
    note="Eq. (72) compares pairs of numbers; their candidates are meant.",
)
STABLE = Statement(
    id="ch11-asymptotic",
    source="ch. 11, Sec. 6, Remark 9; Sec. 7",
    text="With the large swing the error along y goes to zero",
    thesis="“However, this system is not asymptotically stable.”",
    criterion="The limit cycle is the origin",
)
BOUNDED = Statement(
    id="ch11-bounded",
    source="ch. 11, Secs. 6-7, Prop. 2, Figs. 24, 31",
    text="The error along y stays bounded: the oscillation is stable",
    thesis="“… then e_x, e_x', e_y, e_y' are bounded” (Prop. 2).",
    criterion="All eigenvalues of the half-period map at its limit cycle lie within the unit "
    "circle",
)
PERIOD = Statement(
    id="ch11-input-period",
    source="ch. 11, Sec. 7, Fig. 25",
    text="The inputs have the period T of the gait",
    thesis="“The period is identical to the period (T) of the gait planned.”",
    criterion="On the limit cycle the state is back after T, to 1e-9, but not after T/2",
)
PROP_7 = Statement(
    id="ch11-proposition-7",
    source="ch. 11, Sec. 8, Prop. 7, Eq. (77)",
    text="The candidate stays below L_critical + 3/4",
    thesis="“supremum(L(t)) ≤ L_critical + 3/4, where t ≥ t_L.”",
    criterion="The largest candidate of the flight is at most L_critical, computed from Eq. (76), "
    "plus 3/4",
    pictures=("penguin",),
)

CLAIMS = (
    AnalysisClaim(CAN_PUSH, lambda: proof.can_push_straight_ahead(pi / 8), case="small swing, π/8"),
    AnalysisClaim(
        CAN_PUSH,
        lambda: proof.can_push_straight_ahead(pi / 3),
        case="large swing, π/3",
        published=False,
    ),
    AnalysisClaim(LEMMA_1, proof.switch_matrix_is_the_limit),
    AnalysisClaim(LEMMA_2, proof.eq_27_holds),
    AnalysisClaim(SWITCH_LINE, proof.switch_line, published="0.57735", unit="m/s^2"),
    AnalysisClaim(EQ_42, lambda: proof.for_all(proof.eq_42_holds)),
    AnalysisClaim(EQ_43, lambda: proof.for_all(proof.eq_43_holds)),
    AnalysisClaim(TIME, lambda: proof.for_all(proof.eq_44_holds), case="Eq. (44)"),
    AnalysisClaim(TIME, lambda: proof.for_all(proof.eq_47_holds), case="Eq. (47)"),
    AnalysisClaim(WITHIN, lambda: proof.for_all(proof.switches_within)),
    AnalysisClaim(MIRROR, lambda: proof.for_all(proof.comes_back_mirrored)),
    AnalysisClaim(FIRST, proof.first_half_period),
    AnalysisClaim(SLOPE, lambda: proof.slope_matches(1.0), case="Eq. (61)"),
    AnalysisClaim(SLOPE, lambda: proof.slope_matches(-1.0), case="Eq. (67)"),
    AnalysisClaim(
        EQ_66,
        proof.eq_66_holds,
        refuted="A misprint: it must be ė_m, as in its mirror image, Eq. (60).",
    ),
    AnalysisClaim(ENDS, lambda: proof.for_all(proof.largest_at_the_ends)),
    AnalysisClaim(GROWTH, lambda: proof.bound().largest_gain, published="0.75", unit="m^2/s^2"),
    AnalysisClaim(NOWHERE_MORE, lambda: proof.for_all(proof.grows_by_three_quarters_at_most)),
    AnalysisClaim(
        EQ_72,
        proof.eq_72_holds,
        refuted="The sign is reversed: by Eq. (70) a negative ΔL(i) means that the candidate at "
        "(i+1) T/2 is the smaller one. The proof needs and uses that.",
    ),
    AnalysisClaim(STABLE, proof.is_asymptotically_stable, published=False),
    AnalysisClaim(BOUNDED, proof.limit_cycle_is_stable),
    AnalysisClaim(PERIOD, proof.inputs_repeat_after_a_period),
    FlightClaim(
        PROP_7,
        (_LARGE,),
        lambda flights: float(flights[_LARGE]["max_lyapunov"]) <= proof.bound().published,
    ),
)
