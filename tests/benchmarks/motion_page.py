"""Print what `docs/measured/motion-campaign.md` says of the packaged motion campaign: its sentences and its table.

    python tests/benchmarks/motion_page.py

It runs nothing: `hmtb motion` makes the record, `scenarios/data/motion.json`, in 2.5 hours of two processors.
"""

from scenarios.thesis.finding import words
from scenarios.thesis.motion_answer import motion_texts
from scenarios.thesis.motion_section import read_motion
from tests.benchmarks.tables import heading, options, row

KEYS = ("bandwidth_hz", "dc_gain", "gain_half_hz")


def main():
    options(__doc__).parse_args()
    record = read_motion()
    for text in motion_texts(record):
        print(f"- {text}")
    print(
        "\nEvery printed model, and the setting whose models of the same method come nearest to its poles and gains, "
        f"medians over {record['campaign']['seeds']} sequences; drift in multiples of the command:\n"
    )
    columns = []
    for name in ("bandwidth, Hz", "gain at 0 Hz", "at 0.5 Hz"):
        columns += [f"{name}: 1996", "twin"]
    heading("Model", *columns, "off by, tolerances", "servo, slope, mrad/V, V, friction, drift")
    for printed in record["printed"]:
        near = printed["nearest"]
        cells = []
        for key in KEYS:
            cells += [number(printed["numbers"][key]), number(near[f"{printed['method']}_{key}"])]
        setting = f"{near['servo']}, {near['slope']:g}, {1e3 * near['gain']:g}, {near['volts']:g}, "
        setting += f"{100.0 * near['friction']:g} %, {near['drift']:g}"
        row(f"{words(printed['joint'])} {printed['model']}", *cells, number(printed["distance"]), setting)


def number(value):
    """A number with two decimals, or none."""
    return "none" if value is None else f"{value:.2f}"


if __name__ == "__main__":
    main()
