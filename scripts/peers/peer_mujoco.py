"""MuJoCo: a 3D flexcomp of the same tetrahedra, semi-implicit Euler.

Its law is Saint Venant-Kirchhoff in double precision, every node is a body with three sliders. Contacts, constraints
and the implicit treatment of joint damping are switched off, since the job has none of them.
"""

import mujoco
import numpy as np

import job

# A node without mass of its own: MuJoCo has one mass for all nodes, which is put right after compiling.
SCENE = """
<mujoco>
  <option timestep="{dt}" integrator="Euler" gravity="{gravity}">
    <flag contact="disable" constraint="disable" eulerdamp="disable"/>
  </option>
  <worldbody>
    <flexcomp name="block" type="direct" dim="3" dof="full" mass="{mass}" radius="1e-5"
              point="{points}" element="{elements}">
      <contact contype="0" conaffinity="0" selfcollide="none"/>
      <elasticity young="{young}" poisson="{poisson}"/>
      <pin id="{held}"/>
    </flexcomp>
  </worldbody>
</mujoco>
"""


def words(values):
    return " ".join(f"{v:.10g}" for v in np.ravel(values))


class Peer:
    def __init__(self, block):
        self.block = block
        scene = SCENE.format(
            dt=job.DT,
            gravity=words(job.GRAVITY),
            mass=block.masses.sum(),
            points=words(block.positions),
            elements=words(block.tets),
            young=job.YOUNG,
            poisson=job.POISSON,
            held=words(np.nonzero(block.held)[0]),
        )
        # Its warning that no passive forces act is wrong: the block has elasticity.
        mujoco.set_mju_user_warning(lambda text: None)
        self.model = mujoco.MjModel.from_xml_string(scene)
        self.data = mujoco.MjData(self.model)
        self.free = np.nonzero(~block.held)[0]
        # Body 0 is the world; the nodes that move follow in their order.
        self.model.body_mass[1:] = block.masses[self.free]
        mujoco.mj_setConst(self.model, self.data)
        self.data.qvel[:] = block.velocities[self.free].ravel()

    def advance(self, steps):
        mujoco.mj_step(self.model, self.data, nstep=steps)

    def state(self):
        # Sliders: their coordinates are displacements.
        displacements, velocities = (np.zeros_like(self.block.positions) for _ in range(2))
        displacements[self.free] = self.data.qpos.reshape(-1, 3)
        velocities[self.free] = self.data.qvel.reshape(-1, 3)
        return displacements, velocities


if __name__ == "__main__":
    block = job.Block(job.size_of_arguments())
    job.measure(
        block,
        Peer(block),
        name="mujoco",
        version=mujoco.__version__,
        variant="3D flexcomp, Euler",
        precision="f64",
        threads="one",
    )
