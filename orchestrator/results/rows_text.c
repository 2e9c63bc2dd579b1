/* Rows of numbers as CSV text: each number as Python's `repr` writes it, the shortest decimal that reads back as
   the same bits. `file_formats.py` compiles this file and passes the powers of ten.

   The digits are found as R. Giulietti describes in "The Schubfach way to render doubles" (2021): a number c 2^q
   and the two ends of the interval that is rounded to it are multiplied by a power of ten, to an integer part
   with two more bits, the last of which remembers whether anything was cut off. Of the multiples of ten, else of
   one, inside the interval the nearest is taken. */

#include <stdbool.h>
#include <stdint.h>
#include <string.h>

enum { MANTISSA = 52, SMALLEST = -1074, FIRST_POWER = -292 };

/* 10^k / 2^(floor(log2 10^k) - 127), rounded up. */
struct power {
    uint64_t high, low;
};

struct decimal {
    uint64_t digits;
    int exponent;
};

static int floor_log10_pow2(int q)
{
    return (q * 1262611) >> 22;
}

static int floor_log10_three_quarters_pow2(int q)
{
    return (q * 1262611 - 524031) >> 22;
}

static int floor_log2_pow10(int k)
{
    return (k * 1741647) >> 19;
}

/* The integer part of a product; the last bit is set if the rest is not zero. */
static uint64_t product(struct power power, uint64_t factor)
{
    const unsigned __int128 low = (unsigned __int128)power.low * factor;
    const unsigned __int128 sum = (unsigned __int128)power.high * factor + (uint64_t)(low >> 64);
    return (uint64_t)(sum >> 64) | ((uint64_t)sum > 1);
}

/* The shortest decimal of c 2^q > 0 that is rounded to it, and of several the nearest. */
static struct decimal shortest(uint64_t c, int q, const struct power *powers)
{
    const bool near_below = c == (uint64_t)1 << MANTISSA && q > SMALLEST; /* the numbers below are denser */
    const int k = near_below ? floor_log10_three_quarters_pow2(q) : floor_log10_pow2(q);
    const int shift = q + floor_log2_pow10(-k) + 1;
    const struct power power = powers[-k - FIRST_POWER];
    const uint64_t open = c & 1; /* an even number takes the ends of its interval, too */
    const uint64_t low = product(power, (4 * c - 2 + near_below) << shift) + open;
    const uint64_t here = product(power, (4 * c) << shift);
    const uint64_t high = product(power, (4 * c + 2) << shift) - open;
    const uint64_t one = here / 4;
    if (one >= 10) {
        const uint64_t ten = one / 10;
        const bool below = low <= 40 * ten, above = 40 * ten + 40 <= high;
        if (below != above)
            return (struct decimal){ten + above, k + 1};
    }
    const bool below = low <= 4 * one, above = 4 * one + 4 <= high;
    if (below != above)
        return (struct decimal){one + above, k};
    const uint64_t middle = 4 * one + 2;
    return (struct decimal){one + (here > middle || (here == middle && one % 2 == 1)), k};
}

static char *zeros(char *to, int count)
{
    memset(to, '0', count);
    return to + count;
}

static char *copied(char *to, const char *from, int count)
{
    memcpy(to, from, count);
    return to + count;
}

/* Write d.ddde+xx outside of 1e-4 <= x < 1e16, else without exponent, with at least one digit after the point. */
static char *written(char *to, struct decimal value)
{
    char buffer[20], *digits = buffer + sizeof buffer;
    while (value.digits % 10 == 0) {
        value.digits /= 10;
        value.exponent++;
    }
    for (uint64_t rest = value.digits; rest; rest /= 10)
        *--digits = '0' + rest % 10;
    const int n = buffer + sizeof buffer - digits, before = n + value.exponent; /* digits before the point */
    if (before <= -4 || before > 16) {
        *to++ = digits[0];
        if (n > 1) {
            *to++ = '.';
            to = copied(to, digits + 1, n - 1);
        }
        int exponent = before - 1;
        *to++ = 'e';
        *to++ = exponent < 0 ? '-' : '+';
        exponent = exponent < 0 ? -exponent : exponent;
        if (exponent >= 100)
            *to++ = '0' + exponent / 100;
        *to++ = '0' + exponent / 10 % 10;
        *to++ = '0' + exponent % 10;
        return to;
    }
    if (before <= 0) {
        to = copied(to, "0.", 2);
        return copied(zeros(to, -before), digits, n);
    }
    if (before >= n)
        return copied(zeros(copied(to, digits, n), before - n), ".0", 2);
    to = copied(to, digits, before);
    *to++ = '.';
    return copied(to, digits + before, n - before);
}

static char *number(char *to, double x, const struct power *powers)
{
    uint64_t bits;
    memcpy(&bits, &x, sizeof bits);
    const uint64_t fraction = bits & (((uint64_t)1 << MANTISSA) - 1);
    const int exponent = bits >> MANTISSA & 0x7FF;
    if (exponent == 0x7FF && fraction)
        return copied(to, "nan", 3);
    if (bits >> 63)
        *to++ = '-';
    if (exponent == 0x7FF)
        return copied(to, "inf", 3);
    if (exponent == 0 && fraction == 0)
        return copied(to, "0.0", 3);
    if (exponent == 0)
        return written(to, shortest(fraction, SMALLEST, powers));
    return written(to, shortest((uint64_t)1 << MANTISSA | fraction, exponent - 1 + SMALLEST, powers));
}

/* Write rows of numbers, at most 25 characters each, and return how many characters there are. */
__attribute__((visibility("default"))) int64_t rows_text(const double *values, int64_t rows, int64_t columns,
                                                         const struct power *powers, char *text)
{
    char *to = text;
    for (int64_t i = 0; i < rows * columns; i++) {
        to = number(to, values[i], powers);
        *to++ = (i + 1) % columns ? ',' : '\n';
    }
    return to - text;
}
