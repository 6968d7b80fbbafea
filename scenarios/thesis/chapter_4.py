"""Chapter IV in the report: prediction-error models."""

from scenarios.thesis import figures_chapter_4 as draw
from scenarios.thesis.comparison import Comparison
from scenarios.thesis.figure_style import short
from scenarios.thesis.gallery import Gallery
from scenarios.thesis.probability import p_value


def chapter_4(study: Comparison, gallery: Gallery) -> dict[str, object]:
    """Figures and numbers of the chapter.

    Args:
        study: The study.
        gallery: Takes the figures, in the order of the page.

    Returns:
        What the template shows.
    """
    own = study.estimation_test
    captions = {
        5: "the PRBS that they were identified from",
        4: "the two sines at 2.5 and 10 Hz",
        7: "the bipolar ramping pulse",
        8: "the 5-10 Hz chirp",
    }
    joints = []
    for joint, entry in study.joints.items():
        name, mark = short(joint), joint.replace("_", "-")
        joints.append(
            {
                "result": entry,
                "bode": gallery.add(
                    draw.model_bode(entry),
                    f"{name}: frequency response of the truth, of spectral and empirical estimate on the excited lines "
                    "and of the identified models, with 95 % bands. Dashed: −3 dB below one; dotted: 1 Hz; grey: "
                    "nothing is excited there, models extrapolate.",
                    name=f"bode-{mark}",
                ),
                "zoom": gallery.add(
                    draw.zoomed_bode(entry),
                    f"{name}: the gain from 0.1 to 3 Hz; below, by how much it departs from the true gain.",
                    name=f"bode-zoom-{mark}",
                ),
                "published": gallery.add(
                    draw.published_bode(entry),
                    f"{name}: the models that the thesis prints, beside the truth of the twin. Grey: below 0.5 Hz, "
                    "where the PRBS file of the twin excites nothing; that of the thesis is not known.",
                    name=f"bode-published-{mark}",
                ),
                "roots": gallery.add(
                    draw.roots(entry),
                    f"{name}: poles and zeros in the z plane with the unit circle.",
                    name=f"roots-{mark}",
                ),
                "outputs": [
                    gallery.add(
                        draw.outputs(entry, number, length=length),
                        f"{name}: simulated outputs of the models against the measurement of test {number}, "
                        f"{captions[number]}, with their fits over the whole record; below, what is left.",
                        name=f"outputs-{number}-{mark}",
                    )
                    for number, length in ((own, 4.0), (4, 1.6), (7, 3.0), (8, 2.0))
                    if number in entry.data
                ],
                "residuals": [
                    gallery.add(
                        draw.residuals(model),
                        f"{name}, {model.label}: correlations of the residuals on the PRBS test with 99 % bounds "
                        f"(whiteness {p_value(model.residual_test.whiteness_p[0])}, independence "
                        f"{p_value(model.residual_test.independence_p[0, 0])}).",
                        name=f"residuals-{model.method.replace('_', '-')}-{mark}",
                    )
                    for model in entry.models.values()
                ],
            }
        )
    return {"joints": joints}
