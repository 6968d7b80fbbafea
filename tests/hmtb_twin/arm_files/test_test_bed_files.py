"""The files of the test bed's arms: read by anyone, changed in a copy, and strict."""

import shutil

import numpy as np
import pytest

from hmtb_twin import IDEAL, Plant, linearize, load_arm, simulate
from hmtb_twin.arm_files.known_arms import arm_named
from hmtb_twin.parameters.resources import model_file, models_directory
from hmtb_twin.parameters.variants import NUMBERS, VARIANTS
from tests.refusals import refused
from tests.user_arm import write_arm

FOLDER = models_directory() / "hmtb"
FILES = {"nominal": "arm.toml", "published": "published.toml", "flight": "flight.toml", "released": "released.toml"}


def copied(place):
    """Copy the folder of the test bed."""
    return shutil.copytree(FOLDER, place / "bed")


def change(file, old, new, count=1):
    text = file.read_text(encoding="utf-8")
    assert text.count(old) >= count, old
    file.write_text(text.replace(old, new, count), encoding="utf-8")
    return str(file)


@pytest.mark.parametrize("name", FILES)
def test_an_arm_read_from_a_copy_is_the_arm_of_that_name(name, tmp_path, experiment):
    folder = copied(tmp_path)
    copy, own = arm_named(str(folder / FILES[name])), VARIANTS[name]
    for kind in ("joints", "poses", "operating_pose", "tuned_payload", "gravity", "servo", "indexed", "studied"):
        assert getattr(copy, kind) == getattr(own, kind), kind
    for kind in ("motions", "actuators", "servos", "bus", "payloads", "links"):
        mine, theirs = getattr(copy, kind), getattr(own, kind)
        assert list(mine) == list(theirs)
        for key in mine:
            assert mine[key] == theirs[key], (kind, key)
    # A copy tells its numbers; those of the test bed have a table of their own.
    assert copy.numbers == NUMBERS[name]
    assert own.numbers == ()
    log, other = (
        simulate([experiment(variant=arm, axes=("elbow_pitch",), duration=1.0, chain=IDEAL)])[0]
        for arm in (name, copy.name)
    )
    np.testing.assert_array_equal(log.true_angles, other.true_angles)


def test_every_number_has_a_source_and_a_tag():
    for rows in NUMBERS.values():
        assert len(rows) > 100
        for row in rows:
            assert row.source and row.source != "arm.toml", row


def test_a_change_in_a_copy_shows_where_it_should(tmp_path):
    file = copied(tmp_path) / "arm.toml"
    nominal = load_arm()
    faster = load_arm(change(file, "[joint.elbow_pitch]\n", "[joint.elbow_pitch]\nslow_pole = -8.0\n"))
    assert faster.description.servos["elbow_pitch"].slow_pole == -8.0
    assert faster.description.servos["wrist_pitch"].slow_pole == -6.7
    assert faster.gains["elbow_pitch"].kp > 1.05 * nominal.gains["elbow_pitch"].kp
    assert faster.gains["wrist_pitch"] == nominal.gains["wrist_pitch"]
    # The joint alone is faster; the arm to which it is coupled follows a little.
    bandwidth = linearize(faster, amplitudes=()).joint("elbow_pitch").bandwidth_hz
    assert bandwidth > 1.01 * linearize(nominal, amplitudes=()).joint("elbow_pitch").bandwidth_hz
    lighter = load_arm(change(file, "length = 0.56\nmass = 14.0", "length = 0.56\nmass = 7.0"))
    assert nominal.model.body_mass.sum() - lighter.model.body_mass.sum() == pytest.approx(7.0)
    assert load_arm(str(file), worksite=True).worksite


def test_what_contradicts_the_chain_is_refused(tmp_path):
    folder = copied(tmp_path)
    file, original = folder / "arm.toml", (folder / "arm.toml").read_text(encoding="utf-8")

    def tried(message, old, new):
        file.write_text(original, encoding="utf-8")
        refused(message, load_arm, change(file, old, new))

    tried(r"link\.elbow_pitch\.length = 0\.6 m given, expected 0\.56", "length = 0.56", "length = 0.6")
    tried("links .* given, expected those of", "[link.wrist_yaw]", "[link.wrist_yow]")
    tried("no mass given, expected length, mass, radius", "mass = 14.0", "")
    tried(r"link\.elbow_pitch\.mass = -1\.0 given, expected above 0, in kg", "mass = 14.0", "mass = -1.0")
    tried(
        "indexed: shoulder_rol given, available: shoulder_roll",
        'indexed = ["shoulder_roll"]',
        "indexed=['shoulder_rol']",
    )
    tried("studied: nothing given", 'studied = ["shoulder_yaw", ', 'studied = ["nothing", ')
    tried("tuned_payload = 'rpc' given, available: none, rpcm", 'tuned_payload = "rpcm"', 'tuned_payload = "rpc"')
    tried("tool = 'hand' given with links", 'drives = "hydraulic"', 'drives = "hydraulic"\ntool = "hand"')
    tried("rpcm_holster_out_approach: .* beyond the range", "1.5707963267948966, -0.87", "3.5707963267948966, -0.87")
    tried("home: 6 angles given, expected 7", "home = [0.0, ", "home = [")
    tried("no torque of its drive given, expected effort or displacement", "displacement = 25.0\n", "")
    tried(r"trapped volume 8 cm3 of the elbow pitch given", "trapped_volume = 80.0", "trapped_volume = 8.0")
    tried(r"fast_pole = 80\.0 given, expected below 0, in rad/s", "fast_pole = -80.0", "fast_pole = 80.0")
    tried("a faster pole of -4 rad/s given, expected one below -6.7", "fast_pole = -80.0", "fast_pole = -4.0")
    file.write_text(original, encoding="utf-8")
    (folder / "hmtb.xml").write_text(model_file("hmtb/hmtb.xml").read_text(encoding="utf-8") + "<!-- mine -->")
    refused("hmtb.xml is not the hmtb.xml of the test bed whose links they are", load_arm, str(file))


def test_a_file_lies_over_its_base(tmp_path):
    folder = copied(tmp_path)
    over = folder / "over.toml"
    over.write_text(
        'base = "published.toml"\n[joint.elbow_pitch]\ncoulomb_part = {value = 0.002, source = "measured"}\n'
        '[joint.shoulder_yaw]\ncoulomb_part = 0.003\n[sources.joint]\ncoulomb_part = "measured, too"\n',
        encoding="utf-8",
    )
    arm = arm_named(str(over))
    assert arm.servos["elbow_pitch"] == VARIANTS["published"].servos["elbow_pitch"]
    assert arm.actuators["elbow_pitch"].friction.coulomb == 0.002
    told = {(row.owner, row.parameter): (row.value, row.tag, row.source) for row in arm.numbers}
    assert told["elbow_pitch", "coulomb part"] == (0.002, "source", "measured")
    assert told["shoulder_yaw", "coulomb part"] == (0.003, "source", "measured, too")
    for base, message in (
        ("over.toml", "has this file as its own base"),
        ("../bed/../x.toml", "expected the name of another file of its folder"),
        ("none.toml", "expected the name of another file of its folder"),
    ):
        over.write_text(f'base = "{base}"\n', encoding="utf-8")
        refused(message, arm_named, str(over))
    over.write_text("base = 3\n", encoding="utf-8")
    refused("expected the name of another file of its folder", arm_named, str(over))
    (folder / "a.toml").write_text('base = "b.toml"\n', encoding="utf-8")
    (folder / "b.toml").write_text('base = "a.toml"\n', encoding="utf-8")
    refused("has this file as its own base", arm_named, str(folder / "a.toml"))


def test_a_motor_is_described_by_its_data_sheet(tmp_path):
    folder = write_arm(tmp_path)
    toml = folder / "arm.toml"
    toml.write_text(
        "[joint.bend]\ntorque_constant = 0.08\ngear_ratio = 120.0\ncurrent = 5.0\nresistance = 0.9\n"
        "rotor_inertia = 3e-5\nbus_voltage = 48.0\nelectrical_lag = 0.001\nbrake_part = 2.0\ncoulomb_part = 0.02\n"
        "viscous_part = 0.05\nslow_pole = -20.0\nfast_pole = -90.0\nslip_velocity = 0.02\n"
    )
    arm = load_arm(str(folder))
    drive = arm.drives["bend"]
    assert (drive.torque_constant, drive.gear_ratio, drive.largest_current) == (0.08, 120.0, 5.0)
    assert drive.rated_torque == pytest.approx(48.0)
    assert drive.motor.armature == pytest.approx(3e-5 * 120.0**2)
    assert drive.no_load_speed == pytest.approx(48.0 / (0.08 * 120.0))
    assert (drive.resistance, drive.brake_torque, drive.friction.slip_velocity) == (0.9, 2.0, 0.02)
    assert drive.coulomb_torque == pytest.approx(0.02 * 48.0)
    assert drive.drag == pytest.approx(0.05 * 48.0 / drive.no_load_speed)
    servo = arm.description.servos["bend"]
    assert (servo.slow_pole, servo.fast_pole) == (-20.0, -90.0)
    assumed = {row.parameter for row in arm.description.assumed if row.owner == "bend"}
    assert not assumed & {"effort", "armature", "no load speed", "bandwidth", "damping", "coulomb", "viscous"}
    for text, message in (
        ("torque_constant = 0.1\neffort = 20.0", "effort and torque_constant given, which say the same"),
        ("slow_pole = -9.0\nbandwidth = 2.0", "bandwidth and slow_pole given, which say the same"),
        ("displacement = 10.0", "displacement of hydraulic drives given, but drives = 'electric'"),
        ("resistance = 90.0\ntorque_constant = 0.1", r"need 900 V; expected at most"),
    ):
        toml.write_text(f"[joint.bend]\n{text}\n")
        refused(message, load_arm, str(folder))
    toml.write_text('drives = "hydraulic"\n[every_joint]\ngear_ratio = 10.0\n')
    refused("every_joint: gear_ratio of electric drives given, but drives = 'hydraulic'", load_arm, str(folder))


def test_an_own_number_takes_the_place_of_its_rival_for_every_joint(tmp_path):
    folder = write_arm(tmp_path)
    (folder / "arm.toml").write_text("[every_joint]\nbandwidth = 3.0\n[joint.lift]\nslow_pole = -10.0\n")
    servos = load_arm(str(folder)).description.servos
    assert servos["lift"].slow_pole == -10.0
    assert servos["bend"].slow_pole == pytest.approx(-2 * np.pi * 3.0)


def test_gravity_tuned_payload_and_studied_joints_of_any_arm(tmp_path):
    folder = write_arm(tmp_path)
    toml = folder / "arm.toml"
    toml.write_text(
        'gravity = 0.0\ntuned_payload = "tool"\nstudied = ["bend"]\n'
        '[payloads.tool]\nmass = {value = 0.4, source = "scale"}\ncentre = [0.0, 0.0, 0.03]\n'
    )
    arm = load_arm(str(folder))
    assert not arm.weight(arm.pose(arm.description.operating_pose)).any()
    assert (arm.payload, arm.description.compared) == ("tool", ("bend",))
    for text, message in (
        ("gravity = -9.81", "gravity = -9.81 given, expected 0 to 1000 m/s2, downward"),
        ('tuned_payload = "box"', "tuned_payload = 'box' given, available: none"),
        ('studied = ["elbow"]', "studied: elbow given, available: swivel, lift, bend"),
        ('indexed = ["lift"]', "which only arms with links have"),
        (
            "[payloads.box]\nmass = 1.0\nsize = [0.1, 0.1, 0.1]",
            "size given, which only payloads of arms with links have",
        ),
        ("[sources.joint]\nmass = 'x'", "sources.joint: unknown key 'mass'"),
        ("[sources.limb]\nmass = 'x'", "sources: unknown key 'limb'"),
        ("[sources.joint]\neffort = {tag = 'guessed'}", "tag 'guessed' given"),
        ("[link.a]\nmass = 1.0", "no length given"),
    ):
        toml.write_text(f"{text}\n")
        refused(message, load_arm, str(folder))


def test_copies_may_have_other_plants_as_the_test_bed_has(tmp_path):
    folder = copied(tmp_path)
    valves = Plant(actuator="orifice")
    assert dict(load_arm(str(folder), plant=valves).gains) == dict(load_arm(plant=valves).gains)


def test_resolvers_of_any_arm_have_a_resolution_and_a_noise_of_their_own(tmp_path, experiment):
    folder = write_arm(tmp_path)
    toml = folder / "arm.toml"
    toml.write_text('[resolver]\nbits = {value = 12, source = "data sheet"}\nnoise = 1e-3\n')
    arm = load_arm(str(folder))
    step = 2.0 * np.pi / 2**12
    assert (arm.description.recorder.resolver_step, arm.description.recorder.noise) == (step, 1e-3)
    told = {
        row.parameter: (row.value, row.tag, row.source) for row in arm.description.numbers if row.owner == "resolvers"
    }
    assert told == {"bits": (12.0, "source", "data sheet"), "noise": (1e-3, "source", "arm.toml")}
    kind = {"variant": str(folder), "payload": "none", "pose": arm.description.operating_pose, "axes": ("lift",)}
    log = simulate([experiment(duration=4.0, **kind)])[0]
    counts = log.measured / step
    np.testing.assert_allclose(counts, np.round(counts), atol=1e-6)
    late = int(arm.delays[0])
    noise = log.measured[late:] - log.true_angles[: len(log) - late]
    assert np.std(noise) == pytest.approx(np.hypot(1e-3, step / np.sqrt(12.0)), rel=0.1)
    # The truth has the same noise.
    truth = linearize(arm, amplitudes=())
    np.testing.assert_allclose(np.diag(truth.model.innovation_covariance), 1e-6 + step**2 / 12.0, rtol=1e-6)
    for text, message in (
        ("bits = 12.5", "resolver.bits = 12.5 given, expected a whole number of bits over one turn, 8 to 32"),
        ("noise = -1.0", "resolver.noise = -1.0 given, expected 0 rad to 0.1 rad"),
        ("step = 1.0", "resolver: unknown key 'step'"),
    ):
        toml.write_text(f"[resolver]\n{text}\n")
        refused(message, load_arm, str(folder))
