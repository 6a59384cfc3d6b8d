"""The thesis' methods: what their formulas give by hand, what they refuse, and errors as they state them.

Units are simulated by physics: a rotation of scipy for each attitude, gravity and the Earth's rotation in it, noise of
the thesis' table 3.1 on the means of 180 samples. Bounds are chi-square, two-sided, at a false-alarm rate of 1e-3 a
test; the seeds are fixed.
"""

import math
from dataclasses import dataclass, field, replace

import numpy as np
import pytest
from scipy import stats
from scipy.spatial.transform import Rotation

from tumble.attitude import twenty_six_directions
from tumble.calibration import Estimate, Session
from tumble.document import calibration_from_estimate, calibration_of
from tumble.earth import EARTH_RATE, Site
from tumble.errors import ObservabilityError
from tumble.protocol import HoldStep, Pose, Protocol, SpinStep, Step, TurnStep, named_protocol
from tumble.recording import Recording
from tumble.segmentation import HoldMeans, MatchedHold, MatchedSpin, Matching, SpinMeans
from tumble.sensor import ImuModel, Triad
from tumble.simulation import find_grade, simulate_protocol
from tumble_papers.hayal.methods import ESTIMATORS
from unit.given import given

SITE = Site(9.801, 0.0, math.radians(40.0), 0.0, "as simulated")
NOWHERE = replace(SITE, latitude=None)
VERTICAL = EARTH_RATE * math.sin(math.radians(40.0))
FORCE_SIGMA, RATE_SIGMA = 3.6667e-3 / math.sqrt(180.0), 3.6361e-5 / math.sqrt(180.0)
FACES, ALL = twenty_six_directions()[:6], twenty_six_directions()
TABLE_RATE = 1e4 * EARTH_RATE
BOTH_WAYS = (TABLE_RATE, -TABLE_RATE)
# No matrix is near to its transpose. Those of norms are lower triangular; what of six positions is not told is small.
WHOLE = ImuModel(
    Triad(
        np.array([[1.01, 0.004, -0.003], [-0.005, 0.99, 0.002], [0.001, -0.006, 1.04]]),
        np.array([0.1, -0.2, 0.05]),
    ),
    Triad(
        np.array([[0.99, 0.006, -0.003], [-0.004, 1.01, 0.005], [0.007, -0.002, 0.98]]),
        np.array([2e-3, -1e-3, 3e-3]),
    ),
)
LOWER = ImuModel(
    Triad(np.array([[1.02, 0, 0], [-0.011, 0.98, 0], [0.031, -0.019, 1.05]]), np.array([0.1, -0.2, 0.3])),
    Triad(np.array([[0.99, 0, 0], [-0.014, 1.03, 0], [0.037, -0.018, 0.97]]), np.array([2e-6, -5e-6, 3e-6])),
)


def only_diagonal(model: ImuModel, *, unity: bool = False) -> ImuModel:
    """The unit without what a method does not estimate."""
    left = [
        Triad(np.eye(3) if unity else np.diag(np.diag(triad.matrix)), triad.bias)
        for triad in (given(model.accelerometer), given(model.gyroscope))
    ]
    return ImuModel(*left)


@dataclass
class Bench:
    """Attitudes of a unit, each at rest and then spun about the vertical, and what is told of them."""

    model: ImuModel = WHOLE
    up: np.ndarray = field(default_factory=FACES.copy)
    rates: tuple[float, ...] = ()
    told: bool = True
    heading: float | None = None
    site: Site = SITE
    units: tuple[str, str] = ("m/s^2", "rad/s")
    counts: tuple[float, float] = (1.0, 1.0)
    sigma: tuple[float, float] = (FORCE_SIGMA, RATE_SIGMA)
    noise: float = 1.0
    jitter: float = 0.0

    def session(self, seed: int = 0) -> Session:
        """What a recording of it would give: means and their covariances."""
        rng = np.random.default_rng(seed)
        poses = [Pose(up, self.heading) for up in self.up]
        truly = [pose.rotation_nb(rng.uniform(0.0, 2.0 * math.pi)) for pose in poses]
        off = Rotation.from_rotvec(self.jitter * rng.standard_normal((len(poses), 3)))
        down = [t * o for t, o in zip(truly, off, strict=True)]
        force = np.array([d.inv().apply([0.0, 0.0, -SITE.gravity]) for d in down])
        rest = np.array([d.inv().apply(SITE.earth_rate_n) for d in down])
        turns = [(rate + VERTICAL) * f / SITE.gravity for f in force for rate in self.rates]
        steps: list[Step] = []
        for pose in poses:
            steps += [TurnStep(2.0), HoldStep(180.0, pose if self.told else None)]
            steps += [SpinStep(180.0, rate) for rate in self.rates]
        at = [i for i, step in enumerate(steps) if type(step) is HoldStep]
        held = tuple(MatchedHold(i, k) for k, i in enumerate(at))
        turned = tuple(MatchedSpin(i, 0, 1) for i, s in enumerate(steps) if type(s) is SpinStep)
        of_force, of_rate = given(self.model.accelerometer), given(self.model.gyroscope)
        held_force, held_rate = self._shown(of_force, force, 0, rng), self._shown(of_rate, rest, 1, rng)
        spun_force = self._shown(of_force, np.repeat(force, len(self.rates), axis=0), 0, rng)
        spun_rate = self._shown(of_rate, np.reshape(turns, (-1, 3)), 1, rng)
        length, more = np.full(len(force), 180.0), np.full(len(turns), 180.0)
        recording = Recording(np.arange(len(force)) * 200.0, held_force[0], held_rate[0], *self.units, 1.0)
        session = Session(recording, Protocol("bench", "six-position", tuple(steps)), self.site)
        session.means = HoldMeans(*held_force, *held_rate, length, recording.time, length, None)
        session.spins = SpinMeans(*spun_force, *spun_rate, more, more, more, None, period=more)
        session.matching = Matching(held, turned, (), ())
        return session

    def _shown(self, triad, true, kind, rng):
        scale, sigma = self.counts[kind], self.sigma[kind]
        seen = triad.distort(true) + self.noise * sigma * rng.standard_normal(true.shape)
        return scale * seen, (scale * sigma) ** 2 * np.tile(np.eye(3), (len(true), 1, 1))


def estimated(method: str, bench: Bench, seed: int = 0) -> Estimate:
    return ESTIMATORS[method].estimate(bench.session(seed))


def sigma_of(estimate: Estimate, name: str) -> float:
    return next(p.standard_uncertainty for p in estimate.parameters if p.name == name)


def errors(estimate: Estimate, model: ImuModel, kind: str) -> tuple[np.ndarray, np.ndarray]:
    """Errors of a triad's canonical parameters that were estimated, and their covariance."""
    found, true = getattr(estimate.model, kind), getattr(model, kind)
    off = {f"{kind}.matrix[{i},{j}]": (found.matrix - true.matrix)[i, j] for i in range(3) for j in range(3)}
    off |= {f"{kind}.bias[{i}]": (found.bias - true.bias)[i] for i in range(3)}
    rows = [i for i, name in enumerate(estimate.names) if name in off]
    return np.array([off[estimate.names[i]] for i in rows]), estimate.covariance[np.ix_(rows, rows)]


MULTI = Bench(LOWER, ALL, jitter=0.05)
COARSE, BIASES, DIAGONAL = only_diagonal(LOWER), only_diagonal(LOWER, unity=True), only_diagonal(WHOLE)
RUNS = 36
# Against the Earth's own rate the norm's second order shows: as in the thesis' case 3, a rate that is 10,000 times as
# large, or here noise that is a hundredth.
QUIET = (FORCE_SIGMA, 0.01 * RATE_SIGMA)
# (method, bench, estimated numbers of the accelerometers, of the gyros, redundancy)
CASES = {
    "six-position": (Bench(DIAGONAL), 6, 6, 0),
    "improved-six-position": (Bench(WHOLE, np.vstack([FACES, FACES]), heading=0.3), 12, 12, 0),
    "rate-test": (Bench(WHOLE, FACES, (0.3, -0.3, 1.0, -1.0)), 0, 12, 0),
    "modified-multi-position": (Bench(LOWER, ALL, BOTH_WAYS, told=False, jitter=0.05), 9, 9, 17),
    "multi-position-9": (replace(MULTI, sigma=QUIET), 9, 9, 17),
    "multi-position-6": (replace(MULTI, model=COARSE, sigma=QUIET), 6, 6, 20),
    "multi-position-3": (replace(MULTI, model=BIASES, sigma=QUIET), 3, 3, 23),
}


@pytest.mark.parametrize("method", CASES)
def test_errors_are_those_that_it_states(method: str) -> None:
    """Squared errors over the stated covariance are chi-square, or F where the variance of unit weight is estimated."""
    bench, of_force, of_rate, redundancy = CASES[method]
    runs = [estimated(method, bench, seed) for seed in range(RUNS)]
    assert {one.degrees_of_freedom for one in runs} == {redundancy}
    for kind, size in (("accelerometer", of_force), ("gyroscope", of_rate)):
        squares = [square(*errors(one, bench.model, kind)) for one in runs if size]
        chance = stats.f(size, redundancy).cdf if redundancy else lambda q, n=size: stats.chi2.cdf(n * q, n)
        if size:
            assert stats.kstest(chance(np.array(squares) / size), "uniform").pvalue > 1e-3, kind
    if redundancy:
        assert within(sum(one.sigma0**2 * redundancy for one in runs), redundancy * RUNS)


def square(off: np.ndarray, covariance: np.ndarray) -> float:
    scale = np.sqrt(np.diag(covariance))
    return float(off / scale @ np.linalg.solve(covariance / np.outer(scale, scale), off / scale))


def within(square_sum: float, freedom: int) -> bool:
    low, high = stats.chi2.ppf([0.5e-3, 1.0 - 0.5e-3], freedom)
    return bool(low < square_sum < high)


@pytest.mark.parametrize("method", CASES)
def test_in_counts_it_is_the_same(method: str) -> None:
    bench = CASES[method][0]
    counts = replace(bench, units=("counts", "counts"), counts=(400.0, 2e6))
    if method == "multi-position-3":
        with pytest.raises(ObservabilityError, match="Biases alone are not determined in raw counts"):
            estimated(method, counts)
        return
    one, other = estimated(method, bench), estimated(method, counts)
    assert one.names == other.names
    for kind, factor in (("accelerometer", 400.0), ("gyroscope", 2e6)):
        found, same = getattr(one.model, kind), getattr(other.model, kind)
        if found is not None:
            # Adjustments stop at a millionth of a sigma.
            np.testing.assert_allclose(same.matrix, factor * found.matrix, rtol=1e-6, atol=1e-6 * factor)
            np.testing.assert_allclose(same.bias, factor * found.bias, rtol=1e-5)
    sigmas = [np.sqrt(np.diag(e.covariance)) for e in (one, other)]
    expected = np.where([n.startswith("gyro") for n in one.names], 2e6, 400.0)
    np.testing.assert_allclose(sigmas[1] / sigmas[0], expected, rtol=1e-4)


# Figures of the thesis and of its methods page ------------------------------------------------------------


def test_two_readings_of_each_axis_are_2_5_and_2_6_by_hand() -> None:
    """x: 9.901 up and -9.701 down make a bias of 0.1 and a scale factor of 9.801; so do the others."""
    session = Bench(up=np.kron(np.eye(3), [[1.0], [-1.0]]), noise=0.0).session()
    force = given(session.means.specific_force)
    force[:2] = [[9.901, 0.3, 0.2], [-9.701, 0.1, -0.2]]
    force[2:4] = [[0.4, 9.7, 0.0], [0.0, -9.9, 0.2]]
    force[4:] = [[0.1, 0.2, 10.301], [0.3, 0.2, -9.301]]
    standard = ESTIMATORS["six-position"].estimate(session)
    triad = given(standard.model.accelerometer)
    np.testing.assert_allclose(triad.bias, [0.1, -0.1, 0.5], atol=1e-12)
    np.testing.assert_allclose(triad.matrix, np.diag([1.0, 9.8 / 9.801, 1.0]), atol=1e-12)
    assert sigma_of(standard, "accelerometer bias x") == pytest.approx(FORCE_SIGMA / math.sqrt(2.0))
    improved = ESTIMATORS["improved-six-position"].estimate(session)
    triad = given(improved.model.accelerometer)
    # A A' of (2.12) is diagonal: 2 g² and 6. The biases are the means of six readings.
    np.testing.assert_allclose(triad.bias, force.mean(axis=0), atol=1e-12)
    assert triad.matrix[1, 0] == pytest.approx((0.3 - 0.1) / (2.0 * 9.801), abs=1e-12)
    assert sigma_of(improved, "accelerometer bias x") == pytest.approx(FORCE_SIGMA / math.sqrt(6.0))


def test_the_figures_of_the_thesis_noise() -> None:
    """1.9e-4 m/s², 20 ppm; 1.9e-6 rad/s, 41,000 ppm; on a table 1.3 ppm and 2.0 µrad."""
    six = estimated("six-position", Bench(DIAGONAL))
    assert sigma_of(six, "accelerometer bias x") == pytest.approx(1.9e-4, rel=0.03)
    assert sigma_of(six, "accelerometer scale factor error x") == pytest.approx(20e-6, rel=0.03)
    assert sigma_of(six, "gyro bias x") == pytest.approx(1.9e-6, rel=0.03)
    # The scale factor itself is uncertain by 4 %, and its sigma does not know.
    assert sigma_of(six, "gyro scale factor error x") == pytest.approx(0.041, rel=0.03)
    runs = [estimated("modified-multi-position", CASES["modified-multi-position"][0], k) for k in range(9)]
    scale = [sigma_of(one, f"gyro scale factor error {axis}") for one in runs for axis in "xyz"]
    angle = [sigma_of(one, f"gyro non-orthogonality {a}") for one in runs for a in ("yz", "zx", "zy")]
    assert np.mean(scale) == pytest.approx(1.3e-6, rel=0.1)
    assert np.mean(angle) == pytest.approx(2.0e-6, rel=0.1)


@pytest.mark.parametrize(
    ("unknowns", "bias", "scale", "angle"), [(9, 1.07e-6, 0.02, 0.0335), (3, 9.4e-7, 0, 0)]
)
def test_gyros_on_the_earths_rate_are_tables_4_2_and_4_4(unknowns, bias, scale, angle):
    """Mean sigmas of case 2, which vary from run to run by half: 26 headings by chance, and 17 or 23 checks."""
    bench = replace(MULTI, model=BIASES)
    runs = [estimated(f"multi-position-{unknowns}", bench, seed) for seed in range(24)]
    for kind, expected, parts in (
        ("bias", bias, ("x", "y", "z")),
        ("scale factor error", scale, ("x", "y", "z")),
        ("non-orthogonality", angle, ("yz", "zx", "zy")),
    ):
        if expected:
            found = [sigma_of(one, f"gyro {kind} {part}") for one in runs for part in parts]
            assert np.mean(found) == pytest.approx(expected, rel=0.2)


def test_the_earths_rotation_left_out_is_in_the_biases_of_a_rate_test() -> None:
    bench = Bench(DIAGONAL, np.eye(3), BOTH_WAYS, told=False, noise=0.0)
    with_earth, without = (estimated("rate-test", replace(bench, site=site)) for site in (SITE, NOWHERE))
    np.testing.assert_allclose(errors(with_earth, DIAGONAL, "gyroscope")[0], 0.0, atol=1e-7)
    off = errors(without, DIAGONAL, "gyroscope")[0]
    np.testing.assert_allclose(off[3:], VERTICAL * np.array([0.99, 1.01, 0.98]), rtol=1e-9)
    assert f"{VERTICAL:.1e}" == "4.7e-05"
    assert any("No latitude" in said for said in without.not_determined)


def test_axes_that_only_the_accelerometers_show_give_scale_factors_and_biases() -> None:
    estimate = estimated("rate-test", Bench(DIAGONAL, FACES, BOTH_WAYS, told=False))
    assert [n for n in estimate.names if "matrix" in n] == [f"gyroscope.matrix[{i},{i}]" for i in range(3)]
    off, covariance = errors(estimate, DIAGONAL, "gyroscope")
    assert within(square(off, covariance), 6)


def test_an_axis_that_points_down_turns_the_rate_round() -> None:
    session = replace(CASES["modified-multi-position"][0], noise=0.0).session()
    protocol, force = given(session.protocol), given(session.spins.specific_force)
    row = {spin.step: k for k, spin in enumerate(given(session.matching).spins)}
    steps = tuple(
        replace(step, rate=-step.rate, axis_b=-force[row[i]]) if isinstance(step, SpinStep) else step
        for i, step in enumerate(protocol.steps)
    )
    session.protocol = replace(protocol, steps=steps)
    estimate = ESTIMATORS["modified-multi-position"].estimate(session)
    np.testing.assert_allclose(errors(estimate, LOWER, "gyroscope")[0], 0.0, atol=1e-9)


# Gyros that see little, and refusals ----------------------------------------------------------------------


@pytest.mark.parametrize("method", ["six-position", "improved-six-position"])
def test_gyros_that_do_not_see_the_earth_give_their_bias_alone(method: str) -> None:
    estimate = estimated(method, Bench(DIAGONAL, sigma=(FORCE_SIGMA, 1e-4)))
    assert [n for n in estimate.names if "gyro" in n] == [f"gyroscope.bias[{i}]" for i in range(3)]
    assert sigma_of(estimate, "gyro bias y") == pytest.approx(1e-4 / math.sqrt(2.0))
    assert any("not seen well enough" in said for said in estimate.not_determined)


def test_without_headings_the_improved_test_takes_of_the_gyros_what_the_vertical_shows() -> None:
    estimate = estimated("improved-six-position", Bench(WHOLE, sigma=QUIET))
    assert [n for n in estimate.names if "gyroscope.matrix" in n] == [
        f"gyroscope.matrix[{i},{i}]" for i in range(3)
    ]
    assert any("headings are not known" in said for said in estimate.not_determined)


@pytest.mark.parametrize("unknowns", [9, 6, 3])
def test_norms_of_noise_tell_nothing_of_gyros(unknowns: int) -> None:
    for seed in range(8):
        bench = replace(MULTI, sigma=(FORCE_SIGMA, 1e-4))
        estimate = estimated(f"multi-position-{unknowns}", bench, seed)
        assert estimate.model.gyroscope is None
        assert any("do not see the Earth" in said for said in estimate.not_determined)


@pytest.mark.parametrize(
    ("method", "bench", "words"),
    [
        ("six-position", Bench(up=np.delete(FACES, 3, axis=0)), "^No hold with . (up|down) was found"),
        ("improved-six-position", Bench(up=FACES[:2]), r"^No hold with . (up|down), no hold with"),
        ("rate-test", Bench(rates=(TABLE_RATE,), up=FACES[:3]), "^No spin about . "),
        ("rate-test", Bench(), "No spins with a gyro's readings"),
        ("modified-multi-position", Bench(LOWER, ALL, (TABLE_RATE,)), "one way only"),
        ("multi-position-9", Bench(LOWER, ALL[:9]), "^9 attitudes do not determine 9 unknowns .* at least 10"),
    ],
)  # fmt: skip
def test_what_is_missing_is_refused_in_a_sentence(method: str, bench: Bench, words: str) -> None:
    with pytest.raises(ObservabilityError, match=words):
        estimated(method, bench)


# From recordings ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("method", "protocol"),
    [
        ("six-position", "six-position"),
        ("rate-test", "rate-table"),
        ("modified-multi-position", "modified-multi-position"),
        ("multi-position-9", "multi-position-26"),
    ],
)
def test_a_recording_of_the_protocol_gives_the_unit_back(method: str, protocol: str) -> None:
    grade = find_grade("tactical")
    quiet = [
        replace(t, noise=replace(t.noise, bias_instability=0.0))
        for t in (grade.accelerometer, grade.gyroscope)
    ]
    grade = replace(grade, accelerometer=quiet[0], gyroscope=quiet[1])
    played, rng = replace(named_protocol(protocol), site=SITE), np.random.default_rng(4)
    model = DIAGONAL if method == "six-position" else LOWER
    recording, _ = simulate_protocol(played, 20.0, rng, site=SITE, grade=grade, model=model, placement=False)
    # The faces of a six-position test are found without a protocol, too.
    estimate = ESTIMATORS[method].estimate(
        Session(recording, None if method == "six-position" else played, SITE)
    )
    for kind in ("accelerometer", "gyroscope"):
        if getattr(estimate.model, kind) is not None:
            off, covariance = errors(estimate, model, kind)
            # Of a method whose noise is estimated Student's tails: 17 checks make 6 sigmas of 1e-5.
            assert np.all(np.abs(off) < 6.0 * np.sqrt(np.diag(covariance))), kind
    if method in ("six-position", "modified-multi-position"):
        document = calibration_from_estimate(estimate, recording, SITE)
        assert calibration_of(document.to_json()) == document
