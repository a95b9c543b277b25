"""From latitude and longitude to x and y, by a road network's projection.

Transverse Mercator (and UTM, Mercator) of WGS 84, as far as road networks name them. Series of Krueger to sixth order
in the third flattening n: better than a millimetre over a whole zone.

References
----------
.. [1] C. F. F. Karney, Transverse Mercator with an accuracy of a few nanometers, J. Geodesy 85, 2011, eqs. 7-11, 35.
.. [2] J. P. Snyder, Map Projections: A Working Manual, USGS 1395, 1987, eq. 7-7 (Mercator).
"""

from __future__ import annotations

from math import asinh, atan2, atanh, cos, cosh, hypot, log, pi, radians, sin, sinh, sqrt, tan

_RADIUS = 6378137.0
"""Equatorial radius of WGS 84. [m]"""

_FLATTENING = 1.0 / 298.257223563
"""Of WGS 84 [-]; GRS 80 differs by 0.1 mm."""

_UTM_SCALE = 0.9996

_UTM_EASTING = 500000.0

_UTM_SOUTH = 10000000.0


class ProjectionError(ValueError):
    """The road network names no projection, or one that is not known."""


def project(reference: str | None, latitude: float, longitude: float) -> tuple[float, float]:
    """World x, y [m] of a place [rad] by a PROJ string."""
    if not reference or "+proj=" not in reference:
        raise ProjectionError(
            "the road network has no geoReference with a PROJ string: geographic positions have no place"
        )
    words = (word[1:].partition("=") for word in reference.split() if word.startswith("+"))
    settings = {key: value for key, _, value in words}
    try:
        return _project(settings, latitude, longitude)
    except ProjectionError:
        raise
    except (KeyError, ValueError, ZeroDivisionError) as error:
        raise ProjectionError(
            f"the road network's geoReference '{reference.strip()}' is not usable: {error}"
        ) from error


def _project(settings: dict[str, str], latitude: float, longitude: float) -> tuple[float, float]:
    kind = settings["proj"]
    if kind == "utm" and "zone" not in settings and {"lat_0", "lon_0"} <= settings.keys():
        kind = "tmerc"  # field maps name an origin of their own instead of a zone: it is the map's
    if kind == "utm":
        # a zone of UTM as a transverse Mercator projection, by its definition
        y_0 = _UTM_SOUTH if "south" in settings else 0.0
        settings |= {"lon_0": str(6 * int(settings["zone"]) - 183), "lat_0": "0", "k": str(_UTM_SCALE)}
        settings |= {"x_0": str(_UTM_EASTING), "y_0": str(y_0)}
    elif kind not in ("tmerc", "etmerc", "merc"):
        raise ProjectionError(
            f"projection '{kind}' of the road network's geoReference is not known (utm, tmerc, merc are)"
        )
    k = float(settings.get("k", settings.get("k_0", "1")))
    lon_0, lat_0 = radians(float(settings.get("lon_0", "0"))), radians(float(settings.get("lat_0", "0")))
    if kind == "merc":
        x, y = _mercator(latitude, longitude - lon_0, k)
        y_0 = 0.0
    else:
        x, y = _transverse(latitude, longitude - lon_0, k)
        y_0 = _transverse(lat_0, 0.0, k)[1]
    return x + float(settings.get("x_0", "0")), y - y_0 + float(settings.get("y_0", "0"))


def _transverse(latitude: float, longitude: float, k: float) -> tuple[float, float]:
    n = _FLATTENING / (2.0 - _FLATTENING)
    a = _RADIUS / (1.0 + n) * (1.0 + n**2 / 4.0 + n**4 / 64.0 + n**6 / 256.0)
    alpha = (
        n / 2 - 2 * n**2 / 3 + 5 * n**3 / 16 + 41 * n**4 / 180 - 127 * n**5 / 288 + 7891 * n**6 / 37800,
        13 * n**2 / 48 - 3 * n**3 / 5 + 557 * n**4 / 1440 + 281 * n**5 / 630 - 1983433 * n**6 / 1935360,
        61 * n**3 / 240 - 103 * n**4 / 140 + 15061 * n**5 / 26880 + 167603 * n**6 / 181440,
        49561 * n**4 / 161280 - 179 * n**5 / 168 + 6601661 * n**6 / 7257600,
        34729 * n**5 / 80640 - 3418889 * n**6 / 1995840,
        212378941 * n**6 / 319334400,
    )
    e, tau = sqrt(_FLATTENING * (2.0 - _FLATTENING)), tan(latitude)
    sigma = sinh(e * atanh(e * tau / hypot(1.0, tau)))
    tau = tau * hypot(1.0, sigma) - sigma * hypot(1.0, tau)  # of the conformal latitude (Karney, eqs. 7-9)
    xi = atan2(tau, cos(longitude))
    eta = asinh(sin(longitude) / hypot(tau, cos(longitude)))
    north = xi + sum(c * sin(2 * j * xi) * cosh(2 * j * eta) for j, c in enumerate(alpha, 1))
    east = eta + sum(c * cos(2 * j * xi) * sinh(2 * j * eta) for j, c in enumerate(alpha, 1))
    return k * a * east, k * a * north


def _mercator(latitude: float, longitude: float, k: float) -> tuple[float, float]:
    e = sqrt(_FLATTENING * (2.0 - _FLATTENING))
    s = sin(latitude)
    north = log(tan(pi / 4 + latitude / 2) * ((1.0 - e * s) / (1.0 + e * s)) ** (e / 2))
    return k * _RADIUS * longitude, k * _RADIUS * north
