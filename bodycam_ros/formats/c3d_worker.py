"""Reads a C3D in a process of its own and writes its content to stdout: a damaged file crashes ezc3d or never ends.

Run as a program, with the path and the limit of its memory [bytes].
"""

import resource
import sys


def main() -> None:
    """Write the positions (N, K, 3) of markers, their labels, rate, unit and vertical as an npz."""
    import ezc3d
    import numpy as np

    path, most_bytes = sys.argv[1], int(sys.argv[2])
    resource.setrlimit(resource.RLIMIT_AS, (most_bytes, most_bytes))
    file = ezc3d.c3d(path)
    parameters = file["parameters"]["POINT"]
    # Names of the markers; those beyond the 255th are in LABELS2 and so on.
    keys = sorted((key for key in parameters if key.startswith("LABELS")), key=lambda key: int(key[6:] or "1"))
    # Bytes that are no UTF-8 are surrogates in the library's text, which no file or terminal takes.
    labels = [_printable(str(label)).strip() for key in keys for label in parameters[key]["value"]]
    np.savez(
        sys.stdout.buffer,
        positions=np.asarray(file["data"]["points"], np.float64)[:3].transpose(1, 2, 0),
        labels=np.array(labels, dtype=np.str_),
        rate=float(parameters["RATE"]["value"][0]),
        unit=str((parameters.get("UNITS", {}).get("value") or ["mm"])[0]).strip().lower(),
        up=str((parameters.get("Y_SCREEN", {}).get("value") or ["+Z"])[0]).strip().upper(),
    )


def _printable(name: str) -> str:
    return name.encode("utf-8", "replace").decode("utf-8")


if __name__ == "__main__":
    main()
