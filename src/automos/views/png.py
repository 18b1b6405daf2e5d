"""Pictures of few colours as PNG, small enough to be part of a page."""

import base64
import io

import numpy as np
import numpy.typing as npt


def palette_png(image: npt.NDArray[np.uint8], colors: npt.NDArray[np.uint8]) -> bytes:
    """Return a PNG file of `image` (H, W) uint8, rows from the top, whose values index `colors` (K, 4) uint8 RGBA."""
    from PIL import Image

    file, picture = io.BytesIO(), Image.fromarray(np.ascontiguousarray(image))
    picture.putpalette(colors.tobytes(), "RGBA")
    picture.save(file, "PNG", optimize=True)
    return file.getvalue()


def data_url(png: bytes) -> str:
    """Return `png` as the address of an image that is part of the page itself."""
    return "data:image/png;base64," + base64.b64encode(png).decode()
