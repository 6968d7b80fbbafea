"""An arm as a user might bring it: a folder with an MJCF of three joints and a gripper."""

from pathlib import Path

MJCF = """<mujoco model="mine">
  <compiler angle="radian" autolimits="true"/>
  <default><geom density="2700"/></default>
  <worldbody>
    <geom type="cylinder" size="0.1 0.05" pos="0 0 0.05"/>
    <body name="turret" pos="0 0 0.1">
      <joint name="swivel" axis="0 0 1" range="-2.5 2.5" damping="2" armature="0.2" frictionloss="0.5"/>
      <geom type="capsule" fromto="0 0 0 0 0 0.3" size="0.05"/>
      <body name="upper" pos="0 0 0.3">
        <joint name="lift" axis="0 1 0" range="-1.5 1.5" armature="0.15"/>
        <geom type="capsule" fromto="0 0 0 0.4 0 0" size="0.04"/>
        <body name="lower" pos="0.4 0 0">
          <joint name="bend" axis="0 1 0" pos="0 0 0.01" range="-2.2 2.2"/>
          <geom type="capsule" fromto="0 0 0 0.3 0 0.05" size="0.03"/>
          <body name="flange" pos="0.3 0 0.05" euler="0 1.5707963 0">
            <geom type="box" size="0.02 0.03 0.02"/>
            <body name="jaw" pos="0.03 0 0">
              <joint name="gripper" type="slide" axis="1 0 0" range="0.01 0.04"/>
              <geom type="box" size="0.005 0.01 0.03"/>
            </body>
          </body>
        </body>
      </body>
    </body>
  </worldbody>
  <actuator>
    <motor name="swivel" joint="swivel" ctrlrange="-60 60"/>
    <motor name="lift" joint="lift" gear="50" ctrlrange="-1.6 1.6"/>
  </actuator>
  <keyframe><key name="home" qpos="0.1 0.5 0.7 0.02"/></keyframe>
</mujoco>"""


def write_arm(place: Path) -> Path:
    """Write the arm into a folder `mine` of a place."""
    folder = place / "mine"
    folder.mkdir()
    (folder / "mine.xml").write_text(MJCF)
    return folder
