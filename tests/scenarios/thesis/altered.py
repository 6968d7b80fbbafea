"""Studies that differ from the small one in one thing."""

from dataclasses import replace


def with_log(study, name, log):
    """Return the study with another record of its main campaign."""
    main = replace(study.campaign, logs={**study.campaign.logs, name: log})
    return replace(study, campaigns=(main, *study.campaigns[1:]))


def without_log(study, name, why=""):
    """Return the study without a record of its main campaign, which failed for a reason."""
    logs = {key: log for key, log in study.campaign.logs.items() if key != name}
    main = replace(study.campaign, logs=logs, failed={name: why} if why else {})
    return replace(study, campaigns=(main, *study.campaigns[1:]))


def with_models(study, models):
    """Return the study with other models of three joints."""
    return replace(study, multivariable=replace(study.multivariable, models=tuple(models)))


def with_model(study, name, **fields):
    """Return the study with other fields of its identified model of three joints of a name, such as OKID."""
    return with_models(
        study,
        [replace(entry, **fields) if entry.name == f"{name} model" else entry for entry in study.multivariable.models],
    )
