"""Drawing without OpenGL: MuJoCo casts one ray per pixel, NumPy shades what it hits.

For machines on which neither EGL nor OSMesa is installed. All geoms that rays hit are
drawn: planes, boxes, cylinders, meshes, height fields. Camera, colours and light are
those of the model; textures other than the checker of the floor, and highlights, are
left out. A picture of 640 by 480 pixels takes 0.2 s of a core.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
import numpy.typing as npt

from analysis.render.framing import view_axes
from schema.robot.trace import Floats

_VISIBLE = np.array([1, 1, 1, 0, 0, 0], np.uint8)
"""Groups of geoms that MuJoCo shows by default."""
_DEFAULT_COLOUR = 0.5
"""Colour of geoms without one of their own; that of their material replaces it."""
_FAR_M = 1000.0
_LAMP_M = 100.0
"""Distance of the lamp, whose light is parallel in truth [m]."""
_ONTO_M = 1e-4
"""Greatest distance from a lit point at which a ray of the light ends [m]."""
_EDGE = 0.99
"""Cosine of the angle between two surfaces below which there is an edge."""
_SUBPIXELS = ((-0.125, -0.375), (0.375, -0.125), (-0.375, 0.125), (0.125, 0.375))
"""Offsets of the rays that smooth edges, in pixels: a rotated grid."""
_HAZE = 0.3
"""Cosine of the angle of incidence below which the floor fades into the sky."""

Shades = npt.NDArray[np.float32]
"""Brightness, from 0 to 1."""


@dataclass(frozen=True, slots=True)
class _Hits:
    """What some rays hit: geom or -1, normal, and red, green, blue from 0 to 1."""

    geoms: npt.NDArray[np.int32]
    normals: Floats
    is_lit: npt.NDArray[np.bool_]
    colours: Shades


class RayCaster:
    """Draws a model; has the methods of ``mujoco.Renderer`` that renderers here use."""

    def __init__(
        self,
        model: mujoco.MjModel,
        height: int,
        width: int,
        *,
        floor: tuple[str, str, float],
    ) -> None:
        """Prepare the rays to a model with one white lamp.

        ``floor`` is the name of the material that has a checker, that of its texture,
        and the side of its tiles [m]. The sky has the colour of the first tile.
        """
        self._model = model
        self._size = height, width
        name, texture, self._tile_m = floor
        corner = int(model.tex_adr[model.texture(texture).id])
        side = 3 * int(model.tex_width[model.texture(texture).id])
        colours = model.tex_data[corner : corner + side].reshape(-1, 3)[[0, -1]]
        self._tiles: Shades = colours.astype(np.float32) / np.float32(255.0)
        self._is_floor = model.geom_matid == model.material(name).id
        self._rows, self._columns = np.indices(self._size).reshape(2, -1)
        # Half of the picture's height at distance 1, divided by half of its pixels.
        self._pixel = np.tan(np.radians(model.vis.global_.fovy / 2)) / (0.5 * height)
        self._rays = self._rays_of(self._rows, self._columns)
        self._draw: Callable[[], npt.NDArray[np.uint8]] | None = None

    def update_scene(self, data: mujoco.MjData, camera: mujoco.MjvCamera) -> None:
        """Set what ``render`` draws: a state and a free camera."""
        model = self._model
        self._colours = model.geom_rgba[:, :3].copy()
        is_plain = (model.geom_rgba == (*[_DEFAULT_COLOUR] * 3, 1.0)).all(axis=1)
        painted = is_plain & (model.geom_matid >= 0)
        self._colours[painted] = model.mat_rgba[model.geom_matid[painted], :3]
        self._draw = lambda: self._picture(data, camera)

    def render(self) -> npt.NDArray[np.uint8]:
        """Return the picture of the scene, (H, W, 3) red, green, blue."""
        assert self._draw is not None
        return self._draw()

    def close(self) -> None:
        """Do nothing: no resource is held."""

    def _picture(
        self, data: mujoco.MjData, camera: mujoco.MjvCamera
    ) -> npt.NDArray[np.uint8]:
        azimuth, elevation = np.radians((camera.azimuth, camera.elevation))
        axes = view_axes(azimuth, elevation) * [[1.0], [1.0], [-1.0]]
        ahead = axes[2]
        eye = camera.lookat - camera.distance * ahead
        hits = self._hits(data, eye, self._rays @ axes)
        edges = np.flatnonzero(_edges(hits, self._size))
        smooth = np.zeros((len(edges), 3), np.float32)
        for below, aside in _SUBPIXELS:
            rays = self._rays_of(
                self._rows[edges] + below, self._columns[edges] + aside
            )
            smooth += self._hits(data, eye, rays @ axes).colours
        hits.colours[edges] = smooth / len(_SUBPIXELS)
        hits.colours[:] *= 255.0
        picture = hits.colours.round().astype(np.uint8)
        return picture.reshape(*self._size, 3)

    def _rays_of(self, rows: npt.NDArray[Any], columns: npt.NDArray[Any]) -> Floats:
        """Return the rays of pixels as unit vectors, (N, 3) right, up, ahead."""
        height, width = self._size
        aside = self._pixel * (columns - 0.5 * (width - 1))
        above = self._pixel * (0.5 * (height - 1) - rows)
        rays = np.stack([aside, above, np.ones(len(rows))], axis=1)
        return rays / np.sqrt(_products(rays, rays))[:, None]

    def _hits(self, data: mujoco.MjData, eye: Floats, rays: Floats) -> _Hits:
        """Return what rays, (N, 3) unit vectors, hit, and its colour in the light."""
        geoms, distances, normals = self._cast(data, eye, rays)
        is_sky = geoms < 0
        normals[is_sky] = 0.0, 0.0, 1.0
        facing = np.maximum(-_products(rays, normals), 0.0)
        places = eye + distances[:, None] * rays
        head = self._model.vis.headlight
        light, is_lit = self._light(data, places, normals)
        light += head.ambient[0]
        paint = self._colours[geoms]
        floor = np.flatnonzero(self._is_floor[geoms] & ~is_sky)
        slant = facing[floor]
        width = self._pixel * distances[floor] / np.maximum(slant, 0.01)
        share = _checker(places[floor, :2] / self._tile_m, width / self._tile_m)
        paint[floor] = self._tiles[1] + share[:, None] * (
            self._tiles[0] - self._tiles[1]
        )
        paint *= np.minimum(light, 1.0)[:, None]
        haze = np.maximum(1.0 - slant / _HAZE, 0.0)[:, None]
        paint[floor] += haze * (self._tiles[0] - paint[floor])
        paint[is_sky] = self._tiles[0]
        is_lit[is_sky] = False
        return _Hits(geoms, normals, is_lit, paint)

    def _light(
        self, data: mujoco.MjData, places: Floats, normals: Floats
    ) -> tuple[Shades, npt.NDArray[np.bool_]]:
        """Return the diffuse light of the lamp at places, and where it gets to."""
        fall = data.light_xdir[0]
        lamp = data.light_xpos[0] - _LAMP_M * fall
        rays = places - lamp
        lengths = np.sqrt(_products(rays, rays))
        rays /= lengths[:, None]
        _, distances, _ = self._cast(data, lamp, rays)
        slant = np.maximum(-(normals @ fall), 0.0)
        is_lit = (distances > lengths - _ONTO_M) & (slant > 0.0)
        strength = self._model.light(0).diffuse[0] * slant * is_lit
        return strength.astype(np.float32), is_lit

    def _cast(
        self, data: mujoco.MjData, origin: Floats, rays: Floats
    ) -> tuple[npt.NDArray[np.int32], Floats, Floats]:
        """Return geom or -1, distance, and normal of what each ray hits first."""
        count = len(rays)
        geoms = np.full(count, -1, np.int32)
        distances, normals = np.empty(count), np.zeros((count, 3))
        mujoco.mj_multiRay(
            self._model, data, origin, rays.ravel(), _VISIBLE, True, -1,
            geoms, distances, normals.reshape(-1), count, _FAR_M,
        )  # fmt: skip
        return geoms, distances, normals


def _edges(hits: _Hits, size: tuple[int, int]) -> npt.NDArray[np.bool_]:
    """Return which pixels differ from a neighbour in geom, normal or shadow."""
    geoms, is_lit = hits.geoms.reshape(size), hits.is_lit.reshape(size)
    normals = hits.normals.reshape(*size, 3)
    found = np.zeros(size, bool)
    for first, second in ((np.s_[1:, :], np.s_[:-1, :]), (np.s_[:, 1:], np.s_[:, :-1])):
        differs = geoms[first] != geoms[second]
        differs |= is_lit[first] != is_lit[second]
        cosines = np.einsum("ijk,ijk->ij", normals[first], normals[second])
        differs |= cosines < _EDGE
        found[first] |= differs
        found[second] |= differs
    return found.reshape(-1)


def _products(first: Floats, second: Floats) -> Floats:
    products: Floats = np.einsum("ij,ij->i", first, second)
    return products


def _checker(places: Floats, width: Floats) -> Shades:
    """Return the share of the first colour of a checker in pixels.

    Args:
        places: (N, 2) middles of pixels, in tiles.
        width: (N,) side of a pixel on the floor, in tiles.

    Source: the integral of a square wave over a pixel, per axis.
    """
    middles: Shades = places.astype(np.float32)
    reach: Shades = (0.5 * width[:, None]).astype(np.float32)
    waves = _triangle(middles + reach) - _triangle(middles - reach)
    waves /= 2.0 * reach
    return np.asarray(0.5 + 0.5 * waves[:, 0] * waves[:, 1], np.float32)


def _triangle(x: Shades) -> Shades:
    """Return the integral from 0 of a wave that is 1 in [0, 1) and -1 in [1, 2)."""
    rest = x - 2.0 * np.floor(0.5 * x)
    return np.asarray(np.minimum(rest, 2.0 - rest), np.float32)
