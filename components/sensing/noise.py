"""Counter-based noise: a normal random number for a seed, a channel and the index of a message.

    z_n   = mix(key + n g)          g = 2^64 / golden ratio, odd                    SplitMix64
    u_n   = (z_n / 2^12 + 1/2) / 2^52                                               in (0, 1)
    N_k   = sqrt(-2 ln u_2k) cos(2 pi u_2k+1)                                       Box and Muller

The generator has no state, so a number does not depend on the step size, on other channels, on a restored
FMU state or on the program. The key is the FNV-1a hash of "seed/channel", mixed once more.

Source: G. L. Steele, D. Lea, C. H. Flood, Fast splittable pseudorandom number generators, OOPSLA 2014,
figures 16, 17 (with direct access to the n-th number); G. E. P. Box, M. E. Muller, Annals of Mathematical
Statistics 29(2), 1958, 610-611; G. Fowler, L. C. Noll, K.-P. Vo, D. Eastlake, The FNV non-cryptographic hash
algorithm, constants of 64 bits.
"""

from math import cos, log, pi, sqrt

_MASK = (1 << 64) - 1
_GAMMA = 0x9E3779B97F4A7C15
_FNV_START, _FNV_PRIME = 0xCBF29CE484222325, 0x100000001B3


def mix(z: int) -> int:
    """Apply the finalizer of SplitMix64 to a 64-bit integer."""
    z = ((z ^ (z >> 30)) * 0xBF58476D1CE4E5B9) & _MASK
    z = ((z ^ (z >> 27)) * 0x94D049BB133111EB) & _MASK
    return z ^ (z >> 31)


def key(seed: int, channel: str) -> int:
    """Return the key of the noise of a channel with a seed."""
    hashed = _FNV_START
    for byte in f"{seed}/{channel}".encode():
        hashed = ((hashed ^ byte) * _FNV_PRIME) & _MASK
    return mix(hashed)


def uniform(key: int, n: int) -> float:
    """Return the `n`-th number of a key, uniform in (0, 1)."""
    return ((mix((key + (n + 1) * _GAMMA) & _MASK) >> 12) + 0.5) * 2.0**-52


def normal(key: int, k: int) -> float:
    """Return the `k`-th number of a key, normal with mean 0 and standard deviation 1."""
    return sqrt(-2.0 * log(uniform(key, 2 * k))) * cos(2.0 * pi * uniform(key, 2 * k + 1))
