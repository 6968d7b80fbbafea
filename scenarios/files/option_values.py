"""Values of options as words of a command."""


def option_values(value: object) -> list[str]:
    """Words of the value of an option, none of a flag; numbers that belong together, as orders by input, as `1,2`."""
    if value is True:
        return []
    values = value if isinstance(value, tuple) else (value,)
    return [",".join(map(str, one)) if isinstance(one, tuple) else str(one) for one in values]
