"""A moment of a scenario from above, as the player shows it: SVG by our own figures, PNG and GIF with Pillow."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import numpy as np

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.base.errors import XoscLateralError
from xosc_lateral.files.atomic import write_atomically
from xosc_lateral.files.output_paths import PACKAGE, SVG_MARK, claim, output_file
from xosc_lateral.files.pages.chart import INK, PAPER, Panel, color_of, label_of
from xosc_lateral.files.pages.figure import TEXT_SIZE, Figure

if TYPE_CHECKING:
    from PIL.Image import Image


IMAGE_SUFFIXES, ANIMATION_SUFFIXES = (".svg", ".png"), (".gif",)

REACH = 70.0
"""Road that is shown before and behind the vehicle that is looked at. [m]"""
DRAWN_REACH = 400.0
"""Farther away nothing is drawn: pieces of lanes are 200 m long. [m]"""
DASH, PERIOD = 6.0, 18.0
"""Of a broken marking. [m]"""
NOSE = 0.15
"""Share of a vehicle's length over which its front narrows. [-]"""
GIF_STEP = 0.2
"""Between two pictures of an animation; shown in real time. [s]"""
MOST_PICTURES = 600
"""Of an animation: beyond, a GIF is larger than what anybody looks at."""
ASPHALT, VERGE, PAINT, YELLOW = "#b9c0c6", "#dfe4e7", "#ffffff", "#e8b500"


class PictureScene:
    """The player's scene, seen at any time; `text`: as `scene_of` gives it."""

    def __init__(self, text: str) -> None:
        self._scene: dict[str, Any] = json.loads(text)
        self._entities = [_unpacked(one) for one in self._scene["entities"]]
        self._lanes = [(one["type"], _places(one)) for one in self._scene["lanes"]]
        self._marks = [(one, _places(one)) for one in self._scene["marks"]]

    @property
    def end_time(self) -> float:
        """[s]"""
        return float(self._scene["step"] * max(0, self._scene["frames"] - 1))

    def picture(self, time: float, name: str | None = None) -> Figure:
        """From above, driving to the right, widths stretched; dashed: where a vehicle is without its offsets.

        The middle is the vehicle of that name, else the one that the player follows: the first with offsets.
        """
        figure = Figure(height=150.0, axes=False, legend=True)
        (panel,) = figure.panels
        panel.x.limits, across = (-REACH, REACH), float(self._scene["across"])
        panel.y.limits = (-across, across)
        wider = figure.height / across * REACH / figure.width
        shown = [entity for entity in self._entities if self._is_there(entity, time)]
        if not shown:
            panel.line((-REACH, REACH), (0.0, 0.0), VERGE, label=f"nobody is there at {time:g} s")
            return figure
        ranked = sorted(shown, key=lambda entity: (entity["name"] != name, "enriched" not in entity))
        followed = ranked[0]
        x, y, _ = self._pose(followed, "nominal", time)
        camera = x, y, float(self._at(followed, followed["course"], time))
        self._draw_road(panel, camera)
        for vehicle in shown:
            path = "enriched" if "enriched" in vehicle else "nominal"
            outline = _seen(_outline(vehicle, self._pose(vehicle, path, time)), camera)
            is_near = bool((np.abs(outline[:, 0]) < REACH).any())
            panel.area(
                outline[:, 0],
                outline[:, 1],
                color_of(vehicle["number"]),
                label=label_of(vehicle["name"]) if is_near else "",
            )
            if path == "enriched" and is_near:
                around = _seen(_outline(vehicle, self._pose(vehicle, "nominal", time)), camera)
                ghost = np.vstack([around, around[:1]])
                panel.line(ghost[:, 0], ghost[:, 1], INK, width=1.0, dashes="3 2", label="without offsets")
        panel.line((20.0 - REACH, -REACH), (-0.9 * across,) * 2, INK, label=f"20 m; across {wider:.1f} times as large")
        return figure

    def _draw_road(self, panel: Panel, camera: tuple[float, float, float]) -> None:
        for kind, places in self._lanes:
            seen = _seen(places, camera)
            if np.hypot(*seen.T).min() < DRAWN_REACH:
                panel.area(seen[:, 0], seen[:, 1], ASPHALT if kind == "driving" else VERGE)
        for mark, places in self._marks:
            seen = _seen(places, camera)
            if np.hypot(*seen.T).min() < DRAWN_REACH and len(seen) > 1:
                for part in _strokes(seen, mark["start"]) if "broken" in mark["type"] else [seen]:
                    panel.line(part[:, 0], part[:, 1], YELLOW if mark["color"] == "yellow" else PAINT, width=1.6)

    def _at(self, entity: Mapping[str, Any], values: FloatArray, time: float) -> float:
        """Between two frames, but for one that nobody reaches by moving."""
        frame = min(max(time / self._scene["step"], 0.0), len(values) - 1.0)
        if int(frame) + 1 in entity["jumps"]:
            frame = int(frame)
        return float(np.interp(frame, np.arange(len(values)), values))

    def _pose(self, entity: Mapping[str, Any], path: str, time: float) -> tuple[float, float, float]:
        x, y, heading = (self._at(entity, entity[path][name], time) for name in ("x", "y", "h"))
        return x, y, heading

    def _is_there(self, entity: Mapping[str, Any], time: float) -> bool:
        frame = round(time / self._scene["step"])
        return any(first <= frame <= last for first, last in entity["present"])


def _column(packed: Mapping[str, Any]) -> FloatArray:
    return np.asarray(np.cumsum(packed["d"]) * packed["r"])


def _places(drawn: Mapping[str, Any]) -> FloatArray:
    return np.column_stack([_column(drawn["x"]), _column(drawn["y"])])


def _unpacked(entity: dict[str, Any]) -> dict[str, Any]:
    paths = {name: entity[name] for name in ("nominal", "enriched") if name in entity}
    columns: dict[str, Any] = {name: {key: _column(one) for key, one in path.items()} for name, path in paths.items()}
    return {**entity, **columns, "course": _column(entity["course"])}


def _seen(places: FloatArray, camera: tuple[float, float, float]) -> FloatArray:
    """Ahead and to the left of the camera, shape (n, 2). [m]"""
    x, y, course = camera
    ahead, left = np.array([np.cos(course), np.sin(course)]), np.array([-np.sin(course), np.cos(course)])
    return np.column_stack([(places - (x, y)) @ ahead, (places - (x, y)) @ left])


def _outline(entity: Mapping[str, Any], pose: tuple[float, float, float]) -> FloatArray:
    """Of a vehicle from above, its front narrower, shape (6, 2). [m]"""
    x, y, heading = pose
    front, half = 0.5 * entity["length"], 0.5 * entity["width"]
    shoulder = front - NOSE * entity["length"]
    along = np.array([-front, shoulder, front, front, shoulder, -front]) + entity["ahead"]
    across = half * np.array([-1.0, -1.0, -0.6, 0.6, 1.0, 1.0]) + entity["left"]
    cos, sin = np.cos(heading), np.sin(heading)
    return np.column_stack([x + along * cos - across * sin, y + along * sin + across * cos])


def _strokes(line: FloatArray, start: float) -> Iterable[FloatArray]:
    """Dashes of a broken marking whose first place is at s = start. [m]"""
    way = start + np.r_[0.0, np.cumsum(np.hypot(*np.diff(line, axis=0).T))]
    for first in np.arange(np.floor(way[0] / PERIOD) * PERIOD, way[-1], PERIOD).tolist():
        begin, end = max(first, way[0]), min(first + DASH, way[-1])
        if end > begin:
            at = np.array([begin, end])
            yield np.column_stack([np.interp(at, way, line[:, 0]), np.interp(at, way, line[:, 1])])


def marked(svg: str) -> str:
    """An SVG document that says who wrote it."""
    head, _, body = svg.partition(">")
    return f"{head}>{SVG_MARK}{body}"


def write_image(
    scene: str, path: str | Path, at: float | None, *, usual_name: str, inputs: Iterable[Path] = (), force: bool = False
) -> Path:
    """Write a moment as ``.svg`` or ``.png`` (extra `pictures`); `at`: half of the run by default. [s]

    Raises
    ------
    ValueError
        A time beyond the run.
    """
    output = output_file(path, f"{usual_name}.svg", IMAGE_SUFFIXES)
    claim([output], inputs, force=force)
    shown = PictureScene(scene)
    time = 0.5 * shown.end_time if at is None else at
    if not 0.0 <= time <= shown.end_time + GIF_STEP:
        raise ValueError(f"at {time:g} s: the run is from 0 to {shown.end_time:.1f} s")
    figure = shown.picture(time)
    if output.suffix.lower() == ".svg":
        return write_atomically(output, marked(figure.svg()))
    (image,) = rasters([figure])
    from PIL.PngImagePlugin import PngInfo

    data = BytesIO()
    about = PngInfo()
    about.add_text("Software", PACKAGE.decode())
    image.save(data, "PNG", pnginfo=about)
    return write_atomically(output, data.getvalue())


def write_animation(
    scene: str, path: str | Path, *, usual_name: str, inputs: Iterable[Path] = (), force: bool = False
) -> Path:
    """Write the whole run as ``.gif`` (extra `pictures`), in real time."""
    output = output_file(path, f"{usual_name}.gif", ANIMATION_SUFFIXES)
    claim([output], inputs, force=force)
    shown = PictureScene(scene)
    times = np.arange(0.0, shown.end_time + 0.5 * GIF_STEP, GIF_STEP).tolist()
    if len(times) > MOST_PICTURES:
        raise ValueError(
            f"an animation of {shown.end_time:.0f} s: at most {MOST_PICTURES * GIF_STEP:.0f} s; --time-limit"
        )
    images = list(rasters(map(shown.picture, times)))
    from PIL import Image, ImageOps

    high = max(image.height for image in images)  # legends may have more or fewer rows
    frames = [
        ImageOps.expand(image, (0, high - image.height, 0, 0), "white").quantize(64, dither=Image.Dither.NONE)
        for image in images
    ]
    data, step = BytesIO(), round(1000 * GIF_STEP)
    frames[0].save(data, "GIF", save_all=True, append_images=frames[1:], duration=step, loop=0, comment=PACKAGE)
    return write_atomically(output, data.getvalue())


# ---- figures as pixels, by resvg and Pillow: same figure, same pixels ----
DPI = 108.0
"""1.5 pixels to a point of a figure."""


def rasters(figures: Iterable[Figure]) -> Iterator[Image]:
    """Pixels of each figure.

    Raises
    ------
    XoscLateralError
        Pillow or resvg is not installed.
    """
    try:
        from PIL import Image, ImageFont
        from resvg_py import svg_to_bytes
    except ImportError as error:
        raise XoscLateralError(
            "PNG and GIF need Pillow and resvg: pip install 'xosc-lateral[pictures]'; .svg does not"
        ) from error
    font = ImageFont.load_default(TEXT_SIZE)
    assert isinstance(font, ImageFont.FreeTypeFont)
    with TemporaryDirectory() as folder:
        file = Path(folder) / "font.ttf"
        file.write_bytes(font.font_bytes)  # Pillow's own is the same everywhere; others are for letters that it lacks
        family = f"svg, text {{ font-family: {font.getname()[0]} }}"
        for svg in (figure.svg() for figure in figures):
            pixels = svg_to_bytes(
                svg_string=svg, dpi=DPI, background=PAPER, style_sheet=family, font_files=[str(file)],
                skip_system_fonts=svg.isascii(),
            )  # fmt: skip
            yield Image.open(BytesIO(pixels)).convert("RGB")
