"""Draws shapes off-screen with MuJoCo's renderer, in a process of its own: a graphics driver may take it down.

`python -m hil.render.engine` reads a pickled scene from standard input and writes raw RGB rows.
"""

import os
import pickle
import subprocess
import sys

import numpy as np
from numpy.typing import NDArray

from hil.render.scene import Scene

BACKENDS = ("egl", "osmesa")
TIMEOUT_S = 60


def draw(scene: Scene) -> NDArray[np.uint8] | None:
    """The picture as (height, width, 3), or None where this machine cannot render with MuJoCo."""
    for backend in BACKENDS:
        environment = {**os.environ, "MUJOCO_GL": backend}
        try:
            done = subprocess.run(
                [sys.executable, "-m", "hil.render.engine"],
                input=pickle.dumps(scene),
                capture_output=True,
                env=environment,
                timeout=TIMEOUT_S,
                check=False,
            )
        except (OSError, subprocess.TimeoutExpired):
            continue
        if done.returncode == 0 and len(done.stdout) == scene.height * scene.width * 3:
            return np.frombuffer(done.stdout, np.uint8).reshape(scene.height, scene.width, 3)
    return None


def _model_text(scene: Scene) -> str:
    from scipy.spatial.transform import Rotation

    geoms = []
    for shape in scene.shapes:
        x, y, z, w = Rotation.from_matrix(shape.rotation).as_quat()
        size = " ".join(f"{s:.4f}" for s in shape.size)
        rgba = " ".join(f"{c:.3f}" for c in shape.colour)
        geoms.append(
            f'<geom type="{shape.kind}" pos="{shape.centre[0]:.4f} {shape.centre[1]:.4f} {shape.centre[2]:.4f}" '
            f'quat="{w:.6f} {x:.6f} {y:.6f} {z:.6f}" size="{size}" rgba="{rgba} 1"/>'
        )
    gx, gy = scene.look_at[0], scene.look_at[1]
    return f"""<mujoco><statistic extent="8" center="0 0 0"/>
<visual><global offwidth="{scene.width}" offheight="{scene.height}" fovy="32"/><quality shadowsize="4096" offsamples="8"/>
<headlight ambient="0.42 0.42 0.42" diffuse="0.35 0.35 0.35" specular="0.05 0.05 0.05"/><map znear="0.02" zfar="30"/></visual>
<asset><texture name="sky" type="skybox" builtin="gradient" rgb1="0.80 0.86 0.90" rgb2="0.96 0.97 0.98" width="64" height="64"/>
<texture name="grid" type="2d" builtin="checker" rgb1="0.62 0.63 0.62" rgb2="0.58 0.59 0.58" width="256" height="256" mark="edge" markrgb="0.5 0.5 0.5"/>
<material name="ground" texture="grid" texrepeat="40 40" texuniform="false"/></asset>
<worldbody><light pos="{gx - 4} {gy + 5} 12" dir="0.3 -0.4 -1" directional="true" diffuse="0.55 0.55 0.5"/>
<geom type="plane" pos="{gx:.3f} {gy:.3f} 0" size="40 40 1" material="ground"/>
{"".join(geoms)}</worldbody></mujoco>"""


def _main() -> int:
    scene: Scene = pickle.load(sys.stdin.buffer)
    import mujoco

    model = mujoco.MjModel.from_xml_string(_model_text(scene))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    camera = mujoco.MjvCamera()
    camera.lookat[:] = scene.look_at
    camera.distance, camera.azimuth, camera.elevation = scene.distance, scene.azimuth_deg, scene.elevation_deg
    with mujoco.Renderer(model, scene.height, scene.width) as renderer:
        renderer.update_scene(data, camera)
        sys.stdout.buffer.write(renderer.render().tobytes())
    return 0


if __name__ == "__main__":
    sys.exit(_main())
