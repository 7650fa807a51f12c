"""Packed letters back to bytes, as the page's scripts read them."""

from ptae_lite.live.packing import FIRST


def bytes_of(letters: str, count: int) -> bytes:
    bits = "".join(f"{ord(letter) - FIRST:015b}" for letter in letters)
    return bytes(int(bits[8 * i : 8 * i + 8], 2) for i in range(count))
