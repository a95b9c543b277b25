"""Seeds of independent sources: numpy's own children, whatever was drawn before."""

from __future__ import annotations

import zlib

import numpy as np

from xosc_lateral.drivers.model.seeds import (
    AutoregressiveSeed,
    DriveSeed,
    TwoLevelSeed,
    child,
    generator,
    of_driver,
    of_name,
)


def test_the_children_are_those_that_numpy_spawns() -> None:
    spawned = np.random.SeedSequence(7).spawn(3)
    for key, expected in enumerate(spawned):
        assert child(np.random.SeedSequence(7), key).generate_state(4).tolist() == expected.generate_state(4).tolist()


def test_a_child_leaves_its_seed_as_it_was() -> None:
    seed = np.random.SeedSequence(7)
    before = seed.generate_state(4).tolist()
    child(seed, 1)
    assert seed.n_children_spawned == 0
    assert seed.generate_state(4).tolist() == before


def test_a_child_of_a_child_has_both_keys() -> None:
    seed = np.random.SeedSequence([1, 2])
    assert child(child(seed, 3), 4).spawn_key == child(seed, 3, 4).spawn_key == (3, 4)
    assert child(seed, 3).entropy == [1, 2]


def test_the_size_of_the_pool_is_handed_down() -> None:
    assert child(np.random.SeedSequence(7, pool_size=8), 1).pool_size == 8


def test_sources_share_no_number() -> None:
    seed = np.random.SeedSequence(9)
    first = [generator(seed, key).random() for key in (*DriveSeed, *range(20, 40))]
    below = [generator(seed, DriveSeed.CORE, key).random() for key in {*TwoLevelSeed, *AutoregressiveSeed}]
    assert len(set(first + below)) == len(first) + len(below)


def test_the_same_key_gives_the_same_numbers_every_time() -> None:
    seed = np.random.SeedSequence(9)
    assert generator(seed, 5).random(3).tolist() == generator(seed, 5).random(3).tolist()


def test_keys_are_what_older_profiles_were_sampled_with() -> None:
    """Changing one changes what every profile and seed give."""
    assert [(seed.name, seed.value) for seed in DriveSeed] == [
        ("CORE", 0),
        ("HIDDEN", 1),
        ("SLOPES", 2),
        ("SENSOR", 77),
    ]
    assert [seed.value for seed in TwoLevelSeed] == [0, 1, 2]
    assert [seed.value for seed in AutoregressiveSeed] == [0, 1, 2, 3]


def test_names_that_share_a_checksum_of_32_bits_are_two_drivers() -> None:
    assert zlib.crc32(b"plumless") == zlib.crc32(b"buckeroo")
    one, other = (of_driver(1, name).generate_state(4).tolist() for name in ("plumless", "buckeroo"))
    assert one != other
    assert of_name("Car 1").bit_length() > 100
    assert of_driver(1, "a", variant=2).generate_state(4).tolist() != of_driver(1, "a").generate_state(4).tolist()
