"""A driver in C: the offsets of `sample`, whatever the profile, the context and the steps."""

from __future__ import annotations

import subprocess
from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace

from tests.kit.compiled import SANITIZED, CompiledDriver, build, row_of, segment_of, varying
from tests.kit.effects import EXAMPLES, OF_OTHER_COLUMNS, made
from tests.kit.profiles import REFINED
from xosc_lateral.base.errors import DriverProfileError
from xosc_lateral.cli import main
from xosc_lateral.drivers.fitting.models.two_level import fit_two_level
from xosc_lateral.drivers.model.core.autoregressive.parameters import Volatility
from xosc_lateral.drivers.model.effects import (
    EFFECTS,
    Acts,
    ColumnEffect,
    Effect,
    Factor,
    Form,
    HiddenEffect,
    Linear,
    Nearness,
    Product,
    Threshold,
)
from xosc_lateral.drivers.model.profile import DriverProfile, Provenance
from xosc_lateral.drivers.model.sampling import sample_offsets
from xosc_lateral.drivers.model.seeds import child
from xosc_lateral.drivers.model.stream import OffsetStream
from xosc_lateral.extras.live.c_numbers import numbers_of
from xosc_lateral.extras.live.export import c_sources, export_c, export_fmu
from xosc_lateral.extras.live.traffic import Moment, Traffic
from xosc_lateral.files.profiles import read_profile, write_profile

SHIPPED = sorted(path.stem for path in (Path(__file__).resolve().parents[3] / "driver_profiles").glob("*.json"))

TOLERANCE = 1e-9
"""[m]"""

EVERY_FORM = tuple(
    Product(
        acts=Acts.LOCATION, coefficients=(0.01,), errors=(0.1,), reference=(0.2,), between_drivers=(0.02,), lag_s=lag,
        factors=(Factor(column="x", form=form, at=2.0), Factor(column="y", form=Form.VALUE, at=1.0)),
    )
    for form, lag in zip(Form, (-0.5, 0.0, 0.3, 1.0, 2.0, -1.0, 7.3), strict=True)
)  # fmt: skip

MORE = (
    Threshold(acts=Acts.FINE, column="x", at=0.5, coefficients=(0.4,), errors=(0.1,), reference=(0.3,)),
    Nearness(acts=Acts.SPREAD, column="y", presence=True, coefficients=(0.3,), errors=(0.1,), reference=(0.5,)),
    Linear(
        acts=Acts.LOCATION, column="x", coefficients=(0.02,), errors=(0.1,), reference=(1.0,), response_s=3.0,
        response_order=3, course=((0.0, 0.5), (1.5, 0.3), (-0.7, 0.2)), response_range=((-1.0, 1.5),),
    ),
)  # fmt: skip


def two_level() -> DriverProfile:
    run = np.convolve(np.random.default_rng(5).normal(size=6000), np.ones(25) / 60.0, mode="same")
    return DriverProfile("Two levels, ä", fit_two_level([run]), lane_width=3.6)


def compared(driver: CompiledDriver, profile: DriverProfile, rows: int, seed: int, begin: float = 0.0) -> float:
    """Largest difference to the batch call, the context known ahead. [m]"""
    context = varying(driver.columns, rows, seed)
    wanted = sample_offsets(profile, segment_of(context, begin), child(np.random.SeedSequence(seed), 2))
    assert (np.abs(wanted) < 1.5 * context["lane_width"]).all()  # beyond, `sample` goes on, and no vehicle does
    driver.start(seed, drive=2, time=begin)
    for row in range(driver.looks):
        driver.look(row_of(context, row))
    offsets = [driver.step(begin + 0.2 * row, row_of(context, row + driver.looks))[0] for row in range(rows)]
    return float(np.abs(offsets - wanted).max())


@pytest.mark.parametrize("name", SHIPPED)
def test_shipped_profiles_give_the_offsets_of_the_batch_call(name: str, tmp_path: Path) -> None:
    profile = read_profile(name)
    driver = CompiledDriver(profile, tmp_path)
    assert compared(driver, profile, 1500, 3) < TOLERANCE
    assert compared(driver, profile, 400, 2**40 + 7, begin=1000.0) < TOLERANCE


def refused(effect: Effect) -> bool:
    """Whether C lacks an effect, which is then named."""
    try:
        numbers_of(replace(read_profile("rural"), effects=(effect,)))
    except DriverProfileError as error:
        assert repr(effect.kind) in str(error)
        return True
    return False


def weaker(effect: Effect) -> Effect:
    """All of them together stay within what can be driven."""
    if not isinstance(effect, ColumnEffect):
        return effect
    return replace(effect, coefficients=tuple(0.2 * value for value in effect.coefficients))


def test_at_most_two_kinds_of_effects_are_missing_in_c() -> None:
    every = (*EXAMPLES, *OF_OTHER_COLUMNS)
    assert {type(effect) for effect in every} == set(EFFECTS)
    assert sum(map(refused, every)) <= 2


@pytest.mark.parametrize("core", ["motorway", "two-level"])
def test_every_effect_that_a_profile_can_hold_acts_as_in_the_batch_call(core: str, tmp_path: Path) -> None:
    base = two_level() if core == "two-level" else read_profile(core)
    examples = tuple(weaker(effect) for effect in EXAMPLES if not refused(effect))
    for number, effects in enumerate([(*examples, *map(weaker, (*EVERY_FORM, *MORE))), (), examples[::-1][:7]]):
        profile = replace(base, effects=effects)
        driver = CompiledDriver(profile, tmp_path / str(number))
        assert compared(driver, profile, 1500, 1) < TOLERANCE
        assert compared(driver, profile, 300, 0, begin=47.3) < TOLERANCE


def test_a_column_that_is_not_known_does_not_act(tmp_path: Path) -> None:
    profile = read_profile("motorway")
    driver = CompiledDriver(profile, tmp_path)
    context = varying(driver.columns, 200, 4)
    seen = {name: values for name, values in context.items() if name != "right_distance"}
    driver.start(4, known=sum(1 << k for k, name in enumerate(driver.columns) if name in seen))
    for row in range(driver.looks):
        driver.look(row_of(context, row))
    offsets = [driver.step(0.2 * row, row_of(context, row + driver.looks))[0] for row in range(200)]
    wanted = sample_offsets(profile, segment_of(seen), child(np.random.SeedSequence(4), 0))
    np.testing.assert_allclose(offsets, wanted, rtol=0.0, atol=TOLERANCE)


def test_without_looking_ahead_the_driver_responds_later_and_at_any_step_follows_the_streams_curve(
    tmp_path: Path,
) -> None:
    profile = read_profile(REFINED)
    driver = CompiledDriver(profile, tmp_path)
    context = varying(driver.columns, 150, 8) | {"speed": np.full(150, 30.0)}
    stream = OffsetStream(profile, child(np.random.SeedSequence(8), 0), rate=1000.0)
    curve = np.array([stream.step(row_of(context, k // 200)) for k in range(150 * 200)])
    rng, at, driver_at = np.random.default_rng(0), 0, 0
    driver.start(8)
    while at < len(curve):
        if at // 200 > driver_at // 200:  # no model step is passed over: its context would be another
            at = 200 * (driver_at // 200 + 1)
        assert driver.step(at / 1000.0, row_of(context, at // 200))[0] == pytest.approx(curve[at], abs=TOLERANCE)
        driver_at, at = at, at + int(rng.integers(1, 200))


def test_steps_of_a_second_hold_the_context_that_they_are_given(tmp_path: Path) -> None:
    driver = CompiledDriver(read_profile("motorway"), tmp_path)
    context = varying(driver.columns, 60, 5)
    driver.start(5)
    offsets = [driver.step(float(k), row_of(context, k))[0] for k in range(60)]
    driver.start(5)
    held = [driver.step(0.2 * row, row_of(context, -(-row // 5)))[0] for row in range(59 * 5 + 1)]
    np.testing.assert_allclose(offsets, held[::5], rtol=0.0, atol=TOLERANCE)


def starting(speed: float, seconds: float) -> np.ndarray:
    """From a speed on, to a stop, a rest of 3 s and on to 60 km/h. [m/s]"""
    time = 0.05 * np.arange(round(seconds / 0.05))
    return np.interp(time, [0.0, 4.0, 7.0, 10.0, 22.0], [speed, speed, 0.0, 0.0, 16.7])


@pytest.mark.parametrize("kmh", [0.0, 5.0, 20.0, 39.0, 40.0])
def test_c_and_python_drive_alike_from_rest_on_and_after_a_leap(kmh: float, tmp_path: Path) -> None:
    """First step, stop, rest, driving off, and going on a thousand seconds later, in the same context."""
    profile = replace(read_profile("motorway"), effects=())
    driver, traffic = CompiledDriver(profile, tmp_path), Traffic(profile)
    traffic.seed_of = lambda _: child(np.random.SeedSequence(7), 0)  # type: ignore[method-assign]
    one, on = np.ones(1), np.ones(1, dtype=np.bool_)
    apart, place, begin, time = list[float](), 0.3, 0.0, 0.0
    driver.start(7)
    for leap, speeds in ((0.0, starting(kmh / 3.6, 25.0)), (1000.03, starting(kmh / 3.6, 12.0))):
        begin = time + leap
        if leap:
            driver.restart(begin)
            traffic.restart()
        for k, speed in enumerate(speeds):
            time = begin + 0.05 * k
            row = {**dict.fromkeys(driver.columns, np.nan), "speed": speed, "lane_width": 3.6, "position": place}
            ours = traffic.step(time, Moment(("a",), speed * one, 3.6 * one, place * one, on, on, ~on))
            theirs = driver.step(time, row)
            apart.append(float(np.abs(theirs - [ours.offset[0], ours.rate[0], ours.heading[0]]).max()))
            if kmh == 0.0 and not leap and speed == 0.0 and k < 80:
                assert theirs[0] == place and theirs[2] == 0.0, "a car that never moved is where and as it was put"
            place = float(theirs[0])
        place += 0.4  # somebody has put it elsewhere meanwhile
    assert max(apart) < TOLERANCE


def test_the_rate_is_the_offsets_and_the_heading_the_rates(tmp_path: Path) -> None:
    driver = CompiledDriver(read_profile("motorway"), tmp_path)
    usual = row_of(varying(driver.columns, 1, 1), 0)
    driver.start(1)
    rows = np.array([driver.step(0.001 * k, usual) for k in range(4000)])
    np.testing.assert_allclose(np.gradient(rows[:, 0], 0.001)[1:-1], rows[1:-1, 1], atol=1e-6)
    np.testing.assert_allclose(np.sin(rows[:, 2]) * usual["speed"], rows[:, 1], atol=1e-12)


def test_a_saved_driver_goes_on_bit_by_bit_and_a_damaged_one_is_refused(tmp_path: Path) -> None:
    driver = CompiledDriver(read_profile("motorway"), tmp_path)
    context = varying(driver.columns, 400, 6)
    driver.start(6)
    for k in range(200):
        driver.step(0.05 * k, row_of(context, k))
    saved = driver.save()
    after = [driver.step(0.05 * k, row_of(context, k)).tolist() for k in range(200, 400)]
    driver.restore(saved)
    assert [driver.step(0.05 * k, row_of(context, k)).tolist() for k in range(200, 400)] == after
    now = driver.save()
    damaged = bytearray(saved)
    damaged[len(saved) // 3] ^= 1
    for wrong in (bytes(damaged), saved[:-1], saved + b"x", b"", bytes(len(saved))):
        with pytest.raises(ValueError, match="damaged, or of another profile"):
            driver.restore(wrong)
    driver.step(0.05 * 400, row_of(context, 399))
    driver.restore(now)


BAD = {
    "speed": ([np.nan, -1.0, np.inf, 1e9], "speed: "),
    "lane_width": ([0.0, -1.0, 21.0, np.inf], "lane_width: not"),
    "left_distance": ([-np.inf, 1e9], "left_distance: not within -100000 to 100000"),
    "is_truck": ([7.0, -1.0, np.inf], "is_truck: not within 0 to 1"),
    "following": ([np.nan], "following: not a number"),
}


def test_bad_inputs_and_times_are_refused_with_a_reason_and_change_nothing(tmp_path: Path) -> None:
    driver = CompiledDriver(read_profile("motorway"), tmp_path)
    usual = row_of(varying(driver.columns, 1, 1), 0)
    with pytest.raises(ValueError, match="not started"):
        driver.step(0.0, usual)
    for time in (np.nan, np.inf, 1e11):
        with pytest.raises(ValueError, match="time: not a number"):
            driver.start(1, time=time)
    driver.start(1)
    driver.step(0.0, usual)
    before = driver.save()
    for name, (values, message) in BAD.items():
        for value in values:
            with pytest.raises(ValueError, match=message):
                driver.step(0.1, usual | {name: value})
    for value in (np.nan, np.inf, -1e5):
        with pytest.raises(ValueError, match="position: not within 10000 m"):
            driver.step(0.1, usual | {"following": 0.0, "position": value})
    for time in (np.nan, np.inf, -0.1, 60.1):
        with pytest.raises(ValueError, match="time: not a number, before the last one"):
            driver.step(time, usual)
    with pytest.raises(ValueError, match="looks"):
        driver.look(usual)
    driver.step(0.0, usual)
    assert driver.save() == before


def test_effects_and_models_of_plug_ins_are_refused_by_name(tmp_path: Path) -> None:
    class Yawning(HiddenEffect, frozen=True, kw_only=True):
        """Somebody else's."""

    class Sideways(Linear, frozen=True, kw_only=True):
        """Somebody else's too."""

    base = read_profile("rural")
    with pytest.raises(DriverProfileError, match="the C driver has no effect 'yawning'"):
        export_c(replace(base, effects=(Yawning(),)), tmp_path / "c")
    sideways = Sideways(column="x", acts=Acts.FINE, coefficients=(1.0,), errors=(0.1,), reference=(0.0,))
    with pytest.raises(DriverProfileError, match="the C driver has no effect 'sideways'"):
        export_c(replace(base, effects=(sideways,)), tmp_path / "c")
    held = made(Linear, 0.1, column="curvature", episode=0.001)
    with pytest.raises(DriverProfileError, match="the C driver has no effect 'linear' whose last peak is held"):
        export_c(replace(base, effects=(held,)), tmp_path / "c")
    assert not (tmp_path / "c").exists()


@pytest.mark.pages
@pytest.mark.parametrize("name", ["gcc", "clang"])
def test_it_compiles_without_a_warning_and_the_example_runs_under_sanitizers(name: str, tmp_path: Path) -> None:
    write_profile(two_level(), tmp_path / "two.json")
    for number, profile in enumerate((REFINED, str(tmp_path / "two.json"))):
        folder = tmp_path / str(number)
        assert main(["export", "c", "-p", profile, "-o", f"{folder}/", "-q"]) == 0
        program = build(sorted(folder.glob("*.c")), folder / "example", *SANITIZED, name=name)
        lines = subprocess.run([program], capture_output=True, text=True, check=True).stdout.splitlines()
        assert len(lines) == 601 and lines[-1].startswith("60.00 ")
        build(sorted(folder.glob("driver_*.c")), folder / "too.o", "-c", name=name, language="-x c++ -std=c++17")


def test_the_cmake_file_builds_it(tmp_path: Path) -> None:
    cmake = pytest.importorskip("cmake", reason="no cmake here")
    program = Path(cmake.CMAKE_BIN_DIR) / "cmake"
    assert main(["export", "c", "-p", "motorway", "-o", f"{tmp_path}/c/", "-q"]) == 0
    for words in (("-S", tmp_path / "c", "-B", tmp_path / "b"), ("--build", tmp_path / "b")):
        subprocess.run([program, *words], check=True, capture_output=True)
    assert subprocess.run([tmp_path / "b" / "example"], check=True, capture_output=True).stdout.count(b"\n") == 601


def test_files_that_are_there_are_replaced_when_told_to(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["export", "c", "-p", "rural", "-o", f"{tmp_path}/c/", "-q"]
    assert main(words) == 0
    mine = tmp_path / "c" / "example.c"
    mine.write_text("mine")
    assert main(words) == 1 and "--force" in capsys.readouterr().err
    assert mine.read_text() == "mine"
    assert main([*words, "--force"]) == 0 and mine.read_text() != "mine"
    assert main(["export", "c", "-o", str(mine)]) == 1 and "expected a folder" in capsys.readouterr().err


@pytest.mark.parametrize("name", ["gcc", "clang"])
def test_ten_thousand_odd_inputs_are_taken_or_refused_under_sanitizers(name: str, tmp_path: Path) -> None:
    program = (Path(__file__).resolve().parents[2] / "kit" / "odd_inputs.c").read_text(encoding="utf-8")
    for number, profile in enumerate((read_profile("motorway"), replace(two_level(), effects=(*EXAMPLES, *MORE)))):
        source = export_c(profile, tmp_path / str(number))[1]
        (source.parent / "odd.c").write_text(program.replace("DRIVER", source.stem), encoding="utf-8")
        built = build([source, source.parent / "odd.c"], source.parent / "odd", *SANITIZED, name=name)
        done = subprocess.run([built], capture_output=True, text=True, check=False)
        assert done.returncode == 0, (done.returncode, done.stderr)
        taken, refused = map(int, done.stdout.split())
        assert taken > 3000 and refused > 1000


def test_drivers_that_differ_much_and_vary_within_minutes_are_as_in_the_batch_call(tmp_path: Path) -> None:
    base = read_profile("motorway")
    volatility = Volatility(between=0.1, within=0.2, correlation_time=5.0, slow=0.15)
    model = replace(base.model, between_drivers=0.2, coarse_volatility=volatility, fine_volatility=volatility)
    profile = replace(base, model=model)
    driver = CompiledDriver(profile, tmp_path)
    means = []
    for seed in range(20):  # some drivers' means lie beyond where movement bends back
        assert compared(driver, profile, 60, seed) < TOLERANCE
        means.append(driver.step(60.0, row_of(varying(driver.columns, 1, 1), 0))[0])
    assert np.ptp(means) > 1.5


def test_header_and_numbers_state_the_profiles_name_and_licences() -> None:
    profile = read_profile("motorway")
    licence = profile.metadata.licence
    assert licence
    files = c_sources(profile)
    for name in ("driver_motorway.h", "driver_motorway_profile.h"):
        comment = " ".join(files[name].partition("*/")[0].replace("\n *", "").split())
        assert "Driver motorway of xosc-lateral" in comment
        assert f"Licence of the profile: {licence}" in comment
        assert profile.provenance.licence[:60] in comment
    silent = replace(profile, metadata=replace(profile.metadata, licence=""), provenance=Provenance())
    assert "Licence" not in c_sources(silent)["driver_motorway.h"]
    odd = replace(silent, metadata=replace(profile.metadata, licence="\u00e4 */ int x; /* //* https://a.b/*"))
    assert c_sources(odd)["driver_motorway.h"].count("*/") == c_sources(silent)["driver_motorway.h"].count("*/")
    assert c_sources(odd)["driver_motorway.h"].count("/*") == c_sources(silent)["driver_motorway.h"].count("/*")


def test_columns_of_any_name_have_fields_in_c(tmp_path: Path) -> None:
    def of(column: str) -> Linear:
        return Linear(column=column, acts=Acts.LOCATION, coefficients=(0.1,), errors=(0.1,), reference=(0.0,))

    names = ("double", "2nd lead", "Größe", "position", 'a"b\\', "*/")
    profile = replace(read_profile("rural"), effects=tuple(map(of, names)), name='Ä */ "')
    driver = CompiledDriver(profile, tmp_path / "c")
    assert compared(driver, profile, 50, 1) < TOLERANCE
    with pytest.raises(DriverProfileError, match="'a b' and 'a-b' are both x_a_b in C"):
        export_c(replace(profile, effects=(of("a b"), of("a-b"))), tmp_path / "d")


def settled_alone(driver: CompiledDriver, place: float, *, speed: float = 30.0) -> np.ndarray:
    """Offsets of 5 s at 100 Hz of a driver who is put at a place a minute after he began."""
    row = {**dict.fromkeys(driver.columns, np.nan), "speed": speed, "lane_width": 3.6}
    driver.start(7)
    for k in range(60):
        driver.step(float(k), row | {"position": place, "following": 0.0})
    return np.array([driver.step(59.01 + 0.01 * k, row | {"position": place})[0] for k in range(500)])


def test_leading_over_takes_its_time_and_has_no_corner(tmp_path: Path) -> None:
    """Two places 0.2 m apart: the same driver's offsets differ by the rest, a smooth step (of fifth degree) of 3 s."""
    driver = CompiledDriver(replace(read_profile("motorway"), effects=()), tmp_path)
    gap = settled_alone(driver, 0.1) - settled_alone(driver, -0.1)
    u = np.clip(0.01 * np.arange(1, 501) / 3.0, 0.0, 1.0)
    np.testing.assert_allclose(gap, 0.2 * (1.0 - u**3 * (10.0 - 15.0 * u + 6.0 * u**2)), atol=1e-9)


@pytest.mark.parametrize(("push", "most"), [(4.0, 5.4), (-4.0, 5.4), (8.0, 5.4), (-8.0, 5.4), (50.0, 5.4)])
def test_nobody_is_led_beyond_one_and_a_half_lanes(push: float, most: float, tmp_path: Path) -> None:
    """An effect of metres: where it leads to a place within the bound, a vehicle goes there; beyond it, none does."""
    far = Linear(acts=Acts.LOCATION, column="x", coefficients=(push,), errors=(0.1,), reference=(0.0,))
    profile = replace(read_profile("motorway"), effects=(far,))
    driver, traffic = CompiledDriver(profile, tmp_path), Traffic(profile, seed=7)
    one, on = np.ones(1), np.ones(1, dtype=np.bool_)
    driver.start(7)
    ours, theirs = [0.0], [0.0]
    for k in range(600):
        row = {**dict.fromkeys(driver.columns, np.nan), "speed": 30.0, "lane_width": 3.6, "x": float(k > 50)}
        theirs.append(float(driver.step(0.1 * k, row | {"position": theirs[-1]})[0]))
        seen = Moment(("a",), 30.0 * one, 3.6 * one, ours[-1] * one, on, on, ~on, context={"x": one * (k > 50)})
        ours.append(float(traffic.step(0.1 * k, seen).offset[0]))
    for offsets in (ours, theirs):
        largest = float(np.max(np.sign(push) * np.array(offsets)))
        assert largest < most + 1e-9
        assert largest > 0.9 * abs(push) or abs(push) > most


@pytest.mark.pages
@pytest.mark.parametrize("name", ["offset", "rate", "heading", "seed", "fault", "position", "following"])
def test_a_column_called_as_a_variable_of_all_units_is_refused(name: str, tmp_path: Path) -> None:
    effect = Linear(acts=Acts.LOCATION, column=name, coefficients=(0.1,), errors=(0.1,), reference=(0.0,))
    profile = replace(read_profile("motorway"), effects=(effect,))
    with pytest.raises(DriverProfileError, match=f"a column is called '{name}'"):
        export_fmu(profile, tmp_path / "d.fmu", compilers=())
    assert not list(tmp_path.iterdir())
