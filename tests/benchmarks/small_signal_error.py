"""How far the linear truth is from the simulation that it linearises, by amplitude."""

from hmtb_twin import linearize, load_arm


def main():
    """Write a line per amplitude: root mean square of the difference, relative."""
    for amplitude, error in linearize(load_arm()).small_signal_error.items():
        print(f"linear truth against simulation at {1e3 * amplitude:g} mrad: {error:.1e}")


if __name__ == "__main__":
    main()
