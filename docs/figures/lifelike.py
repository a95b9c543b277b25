"""The README's moving picture, from a real conversion: as the maneuvers say, and as people drive (`make picture`)."""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import numpy as np
from PIL import Image, ImageColor, ImageDraw, ImageFont

import xosc_lateral as xl

TEMPLATE, SEED = "dense-traffic", 4
FROM, TO, STEP, SHOWN, TRAIL = 5.0, 25.0, 0.2, 0.1, 1.5  # [s]; a step is shown for half its time
LANES, LANE_WIDTH = 3, 3.75  # [m]; the template's
ALONG, ACROSS = 4.4, 13.2  # [px/m]: widths are stretched by 3
WIDTH, ROAD, LABEL = 800, round(LANES * LANE_WIDTH * ACROSS), 22  # [px]
FINE = 2  # drawn this much larger, then reduced: smooth edges
ASPHALT, MARKING, INK, NOMINAL, TRUCK = "#e9eaee", "#ffffff", "#30343f", "#8a90a0", "Slow"
COLOURS = ("#0072b2", "#d55e00", "#009e73")  # by lane; Okabe and Ito (2008)


def tracks() -> tuple[np.ndarray, dict[str, tuple[np.ndarray, np.ndarray, np.ndarray]]]:
    """Times, and of every vehicle s, nominal t and enriched t along the road [m]."""
    with tempfile.TemporaryDirectory() as folder:
        scenario, _road = xl.write_template(TEMPLATE, folder, duration=30)
        nominal = xl.play(scenario).to_frame()
        enriched = xl.convert(scenario, seed=SEED, ego="none").to_frame()
    nominal["t"] = LANE_WIDTH * (nominal["lane"].astype(int) + 0.5) + nominal["offset_t"]
    found = {}
    for name, rows in nominal.groupby("name"):
        t = rows["t"].to_numpy()
        found[str(name)] = rows["s"].to_numpy(), t, t + enriched.loc[enriched["name"] == name, "deviation"].to_numpy()
    return nominal.loc[nominal["name"] == "Ego", "time"].to_numpy(), found


def frame(time: float, times: np.ndarray, found: dict[str, tuple[np.ndarray, np.ndarray, np.ndarray]]) -> Image.Image:
    """Both roads at one time, seen by a camera that drives along with Ego."""
    size = (WIDTH * FINE, 2 * (ROAD + LABEL) * FINE)
    image = Image.new("RGB", size, "white")
    draw = ImageDraw.Draw(image)
    font = ImageFont.load_default(13 * FINE)
    camera = float(np.interp(time, times, found["Ego"][0]))

    def place(s: np.ndarray, t: np.ndarray, top: int) -> list[tuple[float, float]]:
        x = (WIDTH / 2 + (s - camera) * ALONG) * FINE
        return list(zip(x.tolist(), ((top - t * ACROSS) * FINE).tolist(), strict=True))

    for row, label in enumerate(("as the maneuvers say", "the same maneuvers, as people drive (widths x 3)")):
        top = row * (ROAD + LABEL) + LABEL
        draw.text((6 * FINE, (top - 18) * FINE), label, fill=INK, font=font)
        draw.rectangle((0, top * FINE, size[0], (top + ROAD) * FINE), fill=ASPHALT)
        for lane in range(1, LANES):
            for dash in np.arange(camera - 140 - (camera - 140) % 18, camera + 140, 18.0):
                ends = place(np.array([dash, dash + 6]), np.full(2, -lane * LANE_WIDTH), top)
                draw.line(ends, fill=MARKING, width=3 * FINE)
        for name, (s, *both) in found.items():
            t = both[row]
            past = (times > time - TRAIL) & (times <= time)
            k = int(np.flatnonzero(past)[-1])
            colour = COLOURS[min(max(int(-t[k] // LANE_WIDTH), 0), LANES - 1)]
            draw.line(place(s[past], both[0][past], top), fill=NOMINAL, width=FINE)
            draw.line(place(s[past], t[past], top), fill=colour, width=(1 + 2 * row) * FINE)
            length, width = (14.0, 2.5) if name.startswith(TRUCK) else (4.6, 1.9)
            (x, y), half = place(s[k : k + 1], t[k : k + 1], top)[0], width / 2 * ACROSS * FINE
            draw.rounded_rectangle((x, y - half, x + length * ALONG * FINE, y + half), 3 * FINE, fill=colour)
    return image.resize((WIDTH, size[1] // FINE), Image.Resampling.LANCZOS)


def main(target: Path) -> None:
    """Convert the template and write the picture."""
    times, found = tracks()
    frames = [frame(float(time), times, found) for time in np.arange(FROM, TO, STEP)]
    palette = Image.new("P", (1, 1))
    plain = [ImageColor.getrgb(colour)[:3] for colour in (ASPHALT, MARKING, INK, NOMINAL, *COLOURS)]
    mixed = [tuple((2 * one + two) // 3 for one, two in zip(colour, plain[0], strict=True)) for colour in plain[2:]]
    mixed += [tuple((one + 2 * two) // 3 for one, two in zip(colour, plain[0], strict=True)) for colour in plain[2:]]
    palette.putpalette([value for colour in plain + mixed for value in colour])
    shown = [one.quantize(palette=palette, dither=Image.Dither.NONE) for one in frames]
    shown[0].save(target, save_all=True, append_images=shown[1:], duration=round(1000 * SHOWN), loop=0, optimize=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).with_suffix(".gif"))
