"""What vehicles are, in the words of data sets, simulators and loggers: the one vocabulary of classes.

Words are compared in lower case, whatever parts them: ``Heavy Vehicle``, ``TYPE_HEAVY_TRUCK`` and ``vehicle.truck``.
"""

from __future__ import annotations

import re
from types import MappingProxyType

_WORDS = {
    "car": (
        "car, passenger car, passenger, private, pkw, auto, automobile, sedan, suv, hatchback, coupe, pickup, taxi, "
        "midsize, cabrio, limousine, kombi, small car, compact car, medium car, luxury car, small vehicle, light "
        "vehicle, motor vehicle, regular vehicle, parked vehicle, priority vehicle, emergency vehicle, emergency, "
        "ambulance, police, authority, army, vip, hov, evehicle, custom1, custom2, vehicle, agent, others, av, ego, "
        "personenwagen"
    ),
    "van": "van, minivan, delivery van, delivery, transporter, lieferwagen, minibus, kleintransporter",
    "truck": (
        "truck, lorry, lkw, hgv, lgv, rigid truck, heavy truck, heavy vehicle, medium vehicle, large vehicle, big "
        "vehicle, long vehicle, heavy goods vehicle, goods vehicle, heavy, semi, semi truck, semitruck, semitractor, "
        "tractor, tractor trailer, truck trailer, van trailer, truck bus, articulated truck, sattelzug, lastzug, "
        "lastwagen, lastkraftwagen, sattelschlepper, box truck, truck cab, vehicular trailer truck"
    ),
    "bus": "bus, coach, omnibus, reisebus, linienbus, gelenkbus, school bus, articulated bus, city bus",
    "trailer": (
        "trailer, semitrailer, vehicular trailer, message board trailer, traffic light trailer, anhaenger, anhänger, "
        "auflieger"
    ),
    "motorcycle": "motorcycle, motorbike, motorcyclist, moped, motorrad, kraftrad, krad, powered two wheeler, mofa",
    "bicycle": (
        "bicycle, bicyclist, cyclist, bike, cycle, riderless bicycle, tricycle, rider, fahrrad, radfahrer, velo, "
        "scooter, standup scooter, kick scooter, wheeled rider, wheeled device"
    ),
    "pedestrian": (
        "pedestrian, ped, person, person sitting, people, walker, human, wheelchair, stroller, fussgaenger, fußgänger, "
        "pedestrian bicycle, pedestrian construction worker, pedestrian police officer, pedestrian personal mobility, "
        "official signaler"
    ),
    "train": (
        "train, tram, railed vehicle, rail, rail urban, rail electric, rail fast, subway, strassenbahn, straßenbahn"
    ),
    "thing": (
        "animal, static, background, construction, construction zone, misc, dontcare, building, pillar, road boundary, "
        "median strip, obstacle, ship, aircraft, drone, container, cable car, unknown object, unknown, "
        "sign, stop sign, czone sign, mobile pedestrian crossing sign, bollard, cone, traffic cone, trafficcone, "
        "construction cone, construction barrel, barrier, debris, pushable pullable, bicycle rack, generic object, dog"
    ),
}
"""Class -> words for it. What is unknown may be anything: no vehicle."""

CLASSES = tuple(_WORDS)
CLASS_OF = MappingProxyType({word: name for name, words in _WORDS.items() for word in words.split(", ")})
TRUCKS = frozenset({"truck", "bus", "trailer"})  # as wide and high as trucks: `is_truck`
DRIVEN = frozenset({"car", "van", *TRUCKS, "motorcycle"})  # by whom a lane is followed as drivers of cars do
ON_ROADS = DRIVEN | {"bicycle"}  # what a scenario has as a vehicle
_NAMELESS = frozenset(
    {"", "nan", "none", "null", "other", "other vehicle", "unset", "not set", "-", "n a"}
)  # no class is stated
_PREFIX = re.compile("^(perception label|label|type|class|category|(movable|static) object) ")
_FILLERS = frozenset(
    ("type", "types", "typ", "vehicle", "veh", "class", "object", "adult", "child", "motor", "articulated", "bendy")
) | {"rigid", "police", "traffic", "road"}


def plain_word(word: object) -> str:
    """In lower case, its parts separated by single spaces."""
    parted = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", str(word))
    return " ".join(re.sub(r"[\W_]+", " ", parted).lower().split())


def class_of(word: object) -> str | None:
    """The class that a word stands for; empty where none is stated, None where the word is not known."""
    plain = _PREFIX.sub("", plain_word(word))
    if plain in _NAMELESS:
        return ""
    if plain in CLASS_OF or plain.replace(" ", "") in CLASS_OF:
        return CLASS_OF.get(plain) or CLASS_OF[plain.replace(" ", "")]
    parts = plain.split()
    rest = " ".join(part for part in parts if part not in ("type", "veh", "class", "object", "vehicle", "human"))
    if rest in CLASS_OF:
        return CLASS_OF[rest]
    known = {CLASS_OF[part] for part in parts if part in CLASS_OF and part not in ("vehicle", "human")}
    all_known = all(part in CLASS_OF or part in _FILLERS for part in parts)
    return known.pop() if len(known) == 1 and all_known else None


def class_named(name: str) -> str:
    """The class that a name of somebody's choice speaks of, as ``truck_fast``; empty where it speaks of none."""
    plain = plain_word(name)
    classes = [class_of(part) for part in (plain, *re.sub(r"\d+", " ", plain).split())]
    return next((known for known in classes if known), "")
