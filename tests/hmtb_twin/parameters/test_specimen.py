from dataclasses import replace
from xml.etree import ElementTree

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hmtb_twin import JOINTS, NOMINAL_SPECIMEN, OverloadError, Plant, Specimen, TwinError, linearize, load_arm
from hmtb_twin.arm.controller_model import ControllerModel
from hmtb_twin.arm.rigid_bodies import BODIES
from hmtb_twin.control.experiment import IDEAL
from hmtb_twin.parameters.resources import model_file
from hmtb_twin.parameters.specimen import FARTHEST, LENGTHS, LINK_NAMES
from hmtb_twin.parameters.values import RECORDER
from hmtb_twin.parameters.variants import ACTUATORS, LINKS, OPERATING_POSE
from hmtb_twin.run.simulation import simulate
from hmtb_twin.truth.linearization import sliding, small_signal_error
from tests.refusals import refused


def deviating(seed):
    """A specimen that is off in everything that moves it."""
    rng = np.random.default_rng(seed)

    def scattered(name, spread):
        return tuple(np.exp(rng.normal(0.0, spread, LENGTHS[name])))

    return Specimen(
        mass=scattered("mass", 0.08),
        stretch=tuple(rng.normal(0.0, 0.1, 24)),
        shear=tuple(rng.normal(0.0, 0.1, 24)),
        shift=tuple(rng.normal(0.0, 0.3, 24)),
        payload_mass=1.2,
        dry_friction=scattered("dry_friction", 0.3),
        drag=scattered("drag", 0.3),
        kp=scattered("kp", 0.05),
        kd=scattered("kd", 0.05),
        bulk_modulus=0.8,
        leakage=1.5,
    )


@pytest.mark.slow
@given(st.lists(st.floats(-FARTHEST, FARTHEST), min_size=9, max_size=9), st.floats(0.01, 100.0))
@settings(max_examples=50)
def test_the_log_cholesky_parameters_are_those_of_pinocchio(theta, factor):
    """Of a body of unit mass and unit extents, whose pseudo-inertia is the identity."""
    names = ("stretch", "shear", "shift")
    parts = {name: (*theta[3 * k : 3 * k + 3], *21 * [0.0]) for k, name in enumerate(names)}
    specimen = Specimen(mass=(factor, *7 * [1.0]), **parts)
    masses, centres, inertias = specimen.bodies(np.ones(8), np.zeros((8, 3)), np.full((8, 3), 2.0))
    np.testing.assert_array_equal(inertias[1:], np.tile(2.0 * np.eye(3), (7, 1, 1)))
    mass, centre, inertia = masses[0], centres[0], inertias[0]
    parameters = pin.LogCholeskyParameters(np.array([0.5 * np.log(factor), *theta]))
    known = pin.Inertia.FromLogCholeskyParameters(parameters)
    assert mass == pytest.approx(known.mass, rel=1e-9)
    np.testing.assert_allclose(centre, known.lever, atol=1e-9)
    np.testing.assert_allclose(inertia, known.inertia, atol=1e-9 * np.trace(known.inertia))
    moments = np.linalg.eigvalsh(inertia)
    assert moments[0] > 0.0
    assert moments[0] + moments[1] >= moments[2] * (1.0 - 1e-9)


def test_mass_is_a_plain_factor_gains_let_nothing_droop_and_extremes_are_bodies():
    soft = load_arm(specimen=Specimen(kp=(1.2,) * 7, drag=(2.0,) * 7, bulk_modulus=0.5))
    np.testing.assert_array_equal(soft.rest(soft.pose("home")).qpos, soft.pose("home"))
    ends = np.random.default_rng(0).choice([-FARTHEST, FARTHEST], (3, 24))
    farthest = load_arm(specimen=Specimen(stretch=tuple(ends[0]), shear=tuple(ends[1]), shift=tuple(ends[2])))
    assert (farthest.model.body_inertia[1:] > 0.0).all()
    arm, heavy = load_arm(), load_arm(specimen=Specimen(mass=(1.25,) * 8, payload_mass=1.25))
    np.testing.assert_allclose(heavy.model.body_mass, 1.25 * arm.model.body_mass, rtol=1e-15)
    np.testing.assert_allclose(heavy.model.body_inertia, 1.25 * arm.model.body_inertia, rtol=1e-14)
    np.testing.assert_array_equal(heavy.model.body_ipos, arm.model.body_ipos)
    np.testing.assert_array_equal(heavy.model.dof_armature, arm.model.dof_armature)


@pytest.mark.slow
def test_the_plant_has_the_bodies_of_pinocchio():
    specimen = deviating(1)
    root = ElementTree.fromstring(model_file("hmtb/hmtb.xml").read_text(encoding="utf-8"))
    written = {str(body.get("name")): body.find("inertial") for body in root.iter("body")}
    nominal = [(x.mass, (x.length / 2, 0, 0), (x.axial_inertia, *2 * [x.transverse_inertia])) for x in LINKS.values()]
    bodies = specimen.bodies(*(np.array(column, dtype=float) for column in zip(*nominal, strict=True)))
    for name, mass, centre, inertia in zip(LINKS, *bodies, strict=True):
        inertial = written[BODIES[name]]
        numbers = {"mass": [mass], "pos": centre, "fullinertia": inertia[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]}
        inertial.attrib = {key: " ".join(repr(float(part)) for part in parts) for key, parts in numbers.items()}
    for joint in root.iter("joint"):
        # The pin of the shoulder roll is no part of the bodies.
        joint.attrib.pop("armature", None)
    unit = written["rpcm"]
    unit.set("mass", repr(1.2 * float(unit.get("mass", ""))))
    unit.set("diaginertia", " ".join(repr(1.2 * float(part)) for part in unit.get("diaginertia", "").split()))
    known, arm = ControllerModel(ElementTree.tostring(root, encoding="unicode")), load_arm(specimen=specimen)
    for angles in np.random.default_rng(0).uniform(0.0, 1.5, (5, 7)):
        np.testing.assert_allclose(arm.weight(angles), known.gravity_torque(angles[None])[0], atol=1e-9)
        np.testing.assert_allclose(arm.inertia(angles), known.inertia_matrix(angles), atol=1e-9)


def test_the_controller_knows_the_variant_and_is_shared():
    arm, other = load_arm(), load_arm(specimen=deviating(1))
    # Two that no other test has loaded: an older one may have met its controller before that left the cache.
    first, second = (load_arm(specimen=deviating(seed)) for seed in (1001, 1002))
    assert first.controller is second.controller
    for name, kp, kd in zip(JOINTS, other.specimen.kp, other.specimen.kd, strict=True):
        tuned = arm.gains[name]
        assert other.gains[name] == tuned._replace(kp=kp * tuned.kp, kd=kd * tuned.kd)
    # What is loaded anew, without friction or without power, is the same arm.
    assert sliding(other).specimen == other.specimen
    np.testing.assert_array_equal(other.unpowered.body_mass, other.model.body_mass)
    np.testing.assert_array_equal(other.unpowered.body_iquat, other.model.body_iquat)
    assert (other.unpowered.body_mass[1:] != arm.model.body_mass[1:]).all()


def test_what_the_drives_rub_and_run_on():
    """The same seals and the same oil, asked for in two ways."""
    worn, level = load_arm(specimen=Specimen(dry_friction=(2.0,) * 7)), load_arm(plant=Plant(friction_level=2.0))
    np.testing.assert_array_equal(worn.model.actuator_user, level.model.actuator_user)
    assert not np.array_equal(worn.model.actuator_user, load_arm().model.actuator_user)
    smooth, quiet = load_arm(specimen=Specimen(dry_friction=(0.0,) * 7)), load_arm(friction=False)
    np.testing.assert_array_equal(smooth.model.actuator_user, quiet.model.actuator_user)
    thick = Specimen(drag=(3.0,) * 7, bulk_modulus=0.5, leakage=4.0).applied(3, ACTUATORS["elbow_pitch"])
    plain = ACTUATORS["elbow_pitch"]
    assert thick.drag == pytest.approx(3.0 * plain.drag)
    assert thick.compliance == pytest.approx(2.0 * plain.compliance)
    assert thick.leakage == pytest.approx(4.0 * plain.leakage)
    assert NOMINAL_SPECIMEN.applied(3, plain) is plain


@pytest.mark.parametrize(
    ("variant", "payload", "plant", "friction", "worksite", "still"),
    [
        ("nominal", "rpcm", Plant(), False, False, 1e-11),
        ("published", "mdm", Plant(), False, False, 1e-11),
        ("nominal", "rpcm", Plant(friction="coulomb"), True, False, 1e-9),
        ("nominal", "rpcm", Plant(), False, True, 1e-9),
        # Of the nominal arm with servo valves the pressures are settled to 1e-6 MPa too.
        ("nominal", "rpcm", Plant("orifice"), False, False, 1e-8),
    ],
)
def test_a_drooping_arm_stands_still_where_it_rests(variant, payload, plant, friction, worksite, still):
    arm = load_arm(variant, payload, plant=plant, specimen=deviating(2), friction=friction, worksite=worksite)
    angles = arm.pose(OPERATING_POSE)
    data = arm.rest(angles)
    rest = data.qpos.copy()
    droop = rest[:7] - angles
    assert 3e-4 < np.abs(droop[1:]).max() < 0.05
    # The indexed joint leans on its pin only.
    assert 1e-10 < abs(droop[0]) < 1e-6
    for _ in range(50):
        mujoco.mj_step(arm.model, data, nstep=round(0.02 / arm.model.opt.timestep))
        assert np.abs(data.qpos - rest)[:7].max() < still
    # Leakage that its servo does not know makes it softer.
    springs = [(arm.gains[name], arm.actuators[name]) for name in JOINTS]
    kp = np.array(
        [
            gains.kp
            * ((gains.feed or drive.flow_pressure_gain) + gains.pressure)
            / (drive.flow_pressure_gain + gains.pressure)
            for gains, drive in springs
        ]
    )
    excess = arm.weight(angles + droop) - arm.controller.gravity_torque(angles[None])[0]
    if plant.actuator == "linear":
        np.testing.assert_allclose(-kp[1:] * droop[1:], excess[1:], atol=1e-9)
    # The controller of an arm heavier than its drives hold feeds forward what these would hold.
    with pytest.raises(OverloadError, match="cannot hold the arm at this pose: shoulder pitch needs"):
        load_arm(plant=plant, specimen=Specimen(mass=(6.0,) * 8)).rest(angles)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("variant", "pose", "form", "seed", "amplitude"),
    [
        ("nominal", OPERATING_POSE, "linear", 3, 1e-4),
        ("nominal", OPERATING_POSE, "linear", 4, 1e-4),
        ("published", "home", "linear", 3, 1e-4),
        ("nominal", OPERATING_POSE, "orifice", 3, 1e-5),
    ],
)
def test_the_truth_of_a_drooping_arm_is_as_good_as_that_of_a_nominal_one(variant, pose, form, seed, amplitude):
    arm = load_arm(variant, plant=Plant(form), specimen=deviating(seed))
    designed = load_arm(variant, plant=Plant(form))
    truth, nominal = (linearize(one, pose, amplitudes=(amplitude,)) for one in (arm, designed))
    assert truth.specimen == arm.specimen
    assert truth.small_signal_error[amplitude] < 1.5 * nominal.small_signal_error[amplitude]
    if form == "linear":
        assert small_signal_error(sliding(arm), nominal.model, nominal.angles, amplitude) > 0.01
    # The static gain is what it is because gravity pulls on the drooping arm otherwise than fed forward.
    assert truth.joint("shoulder_pitch").dc_gain != pytest.approx(1.0, abs=1e-5)


@pytest.mark.slow
def test_noise_of_the_resolvers_is_that_of_the_specimen_in_log_and_truth(experiment):
    still = replace(experiment(), amplitude=0.0, duration=20.0, chain=replace(IDEAL, resolver=True))
    # From half a step of noise on, rounding adds step^2/12 also at rest.
    quiet, loud = simulate([replace(still, specimen=Specimen(resolver_noise=factor)) for factor in (5.0, 20.0)])
    scatter = [np.std(log.measured - log.true_angles[0]) ** 2 for log in (quiet, loud)]
    rounding = RECORDER.resolver_step**2 / 12.0
    assert scatter[1] == pytest.approx((20.0 * RECORDER.noise) ** 2 + rounding, rel=0.05)
    assert scatter[0] == pytest.approx((5.0 * RECORDER.noise) ** 2 + rounding, rel=0.05)
    truth = linearize(load_arm(specimen=Specimen(resolver_noise=20.0)), amplitudes=())
    np.testing.assert_allclose(np.diag(truth.disturbances.resolvers), (20.0 * RECORDER.noise) ** 2 + rounding)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"mass": (1.0, 1.1)}, r"^specimen: 2 entries of mass given, expected 8, or none where nothing deviates$"),
        ({"kp": (1.0,) * 6 + (0.0,)}, r"^specimen: kp\[6\] = 0.0 given, expected a number from 0.01 to 100$"),
        ({"shift": (4.0,) * 24}, r"^specimen: shift\[0\] = 4.0 given, expected a number from -3 to 3$"),
        ({"dry_friction": (-0.1,) * 7}, r"^specimen: dry_friction\[0\] = -0.1 given, expected a number from 0 to 100$"),
        ({"bulk_modulus": float("nan")}, "bulk_modulus = nan given, expected a number"),
        ({"mass": "heavy"}, r"mass = 'heavy' given, expected a tuple of numbers$"),
    ],
)
def test_what_no_arm_can_be_is_refused(given, message):
    refused(message, Specimen, **given)


def test_electric_drives_have_no_oil():
    arm = load_arm("flight", specimen=Specimen(mass=(1.1,) * 8, kd=(1.1,) * 7))
    np.testing.assert_allclose(arm.model.body_mass[1:-1], 1.1 * load_arm("flight").model.body_mass[1:-1])
    for name in ("bulk_modulus", "leakage"):
        with pytest.raises(TwinError, match=f"^specimen: {name} = 2.0 given, but the drives of this arm are electric"):
            load_arm("flight", specimen=Specimen(**{name: 2.0}))
    refused(r"expected a Specimen, such as", load_arm, specimen=None)


def test_what_deviates_nowhere_is_nominal_however_it_is_written():
    written = Specimen(mass=[1] * 8, stretch=np.zeros(24), kd=(np.float64(1.0),) * 7)
    assert written == NOMINAL_SPECIMEN
    assert hash(written) == hash(NOMINAL_SPECIMEN)
    assert load_arm(specimen=written) is load_arm()
    other = Specimen(kp=np.full(7, 1.5))
    assert {type(value) for value in other.kp} == {float}
    assert other.deviations == {"kp": (1.5,) * 7}
    assert len(set(LINK_NAMES)) == 8
