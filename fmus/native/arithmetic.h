/* Run-time library of translated components: CPython's arithmetic, growing lists, texts of exceptions. */
#include <math.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "oldest_glibc.h"

#if defined __GNUC__
#define MAYBE_UNUSED __attribute__((unused))
#else
#define MAYBE_UNUSED
#endif

enum { REAL, INTEGER, BOOLEAN, STRING };
enum { INPUT, OUTPUT, PARAMETER };

/* Declaration of a variable; `place` is its offset in Variables. */
typedef struct {
    const char *name;
    int type, causality;
    size_t place;
    double start, min, max;
    const char *const *choices;
    int n_choices;
} Declared;

/* ---- operators ---- */

MAYBE_UNUSED static double mod(double a, double b)
{
    double m = fmod(a, b);
    if (m != 0.0) {
        return (b < 0.0) != (m < 0.0) ? m + b : m;
    }
    return copysign(0.0, b);
}

MAYBE_UNUSED static double floordiv(double a, double b)
{
    double m = fmod(a, b), quotient = (a - m) / b;
    if (m != 0.0 && (b < 0.0) != (m < 0.0)) {
        quotient -= 1.0;
    }
    if (quotient != 0.0) {
        double whole = floor(quotient);
        return quotient - whole > 0.5 ? whole + 1.0 : whole;
    }
    return copysign(0.0, a / b);
}

MAYBE_UNUSED static int undefined_1(double found, double x)
{
    return (isnan(found) && !isnan(x)) || (isinf(found) && isfinite(x));
}

MAYBE_UNUSED static int undefined_2(double found, double x, double y)
{
    return isnan(found) && !isnan(x) && !isnan(y);
}

MAYBE_UNUSED static int zero_power(double a, double b)
{
    return a == 0.0 && b < 0.0 && isfinite(b);
}

MAYBE_UNUSED static int pole_power(double a, double b)
{
    return a == 0.0 && b < 0.0;
}

MAYBE_UNUSED static int complex_power(double a, double b)
{
    return a < 0.0 && isfinite(a) && isfinite(b) && b != floor(b);
}

/* round(x, digits): through the shortest exact text, so of two decimals that are equally near, the even one. */
MAYBE_UNUSED static double rounded(double x, double digits)
{
    char text[400];
    if (!isfinite(x)) {
        return x;
    }
    snprintf(text, sizeof text, "%.*f", (int)digits, x);
    return strtod(text, NULL);
}

/* math.hypot and math.dist: square root of a compensated sum of squares, corrected once. */
MAYBE_UNUSED static double norm(int n, const double *given)
{
    double largest = 0.0, sum = 1.0, lost_1 = 0.0, lost_2 = 0.0, lost_3 = 0.0, old, x, t, high, low, root;
    int exponent, not_a_number = 0;
    for (int i = 0; i < n; i++) {
        x = __builtin_fabs(given[i]);
        not_a_number |= isnan(x);
        largest = x > largest ? x : largest;
    }
    if (isinf(largest)) {
        return largest;
    }
    if (not_a_number) {
        return NAN;
    }
    if (largest == 0.0 || n <= 1) {
        return largest;
    }
    frexp(largest, &exponent);
    if (exponent <= -1023) { /* too small to be scaled, as with subnormal numbers */
        double scaled = 0.0;
        for (int i = 0; i < n; i++) {
            x = __builtin_fabs(given[i]) / 2.2250738585072014e-308;
            scaled += x * x;
        }
        return 2.2250738585072014e-308 * sqrt(scaled);
    }
    const double split = 134217729.0, scale = ldexp(1.0, -exponent);
    for (int i = 0; i < n; i++) {
        x = __builtin_fabs(given[i]) * scale;
        t = x * split, high = t - (t - x), low = x - high;
        x = high * high;
        old = sum, sum += x, lost_1 += (old - sum) + x;
        x = 2.0 * high * low;
        old = sum, sum += x, lost_2 += (old - sum) + x;
        lost_3 += low * low;
    }
    root = sqrt(sum - 1.0 + (lost_1 + lost_2 + lost_3));
    x = root;
    t = x * split, high = t - (t - x), low = x - high;
    x = -high * high;
    old = sum, sum += x, lost_1 += (old - sum) + x;
    x = -2.0 * high * low;
    old = sum, sum += x, lost_2 += (old - sum) + x;
    x = -low * low;
    old = sum, sum += x, lost_3 += (old - sum) + x;
    x = sum - 1.0 + (lost_1 + lost_2 + lost_3);
    return (root + x / (2.0 * root)) / scale;
}

/* sum() since CPython 3.12, after A. Neumaier. */
MAYBE_UNUSED static double compensated_sum(int n, const double *x, const char *plain)
{
    double sum = x[0], lost = 0.0;
    for (int i = 1; i < n; i++) {
        double t = sum + x[i];
        lost += plain[i] ? 0.0 : __builtin_fabs(sum) >= __builtin_fabs(x[i]) ? (sum - t) + x[i] : (x[i] - t) + sum;
        sum = t;
    }
    return lost != 0.0 && isfinite(lost) ? sum + lost : sum;
}

/* ---- sorted(): with NaNs, the order depends on the algorithm, which is CPython's ---- */

enum { MOST_SORTED = 63 }; /* from 64 items on, CPython merges several runs */

#define LESS(i, k) (keys[order[i]] < keys[order[k]])

MAYBE_UNUSED static void reverse(int *first, int *end)
{
    while (first < --end) {
        int number = *first;
        *first++ = *end, *end = number;
    }
}

/* Make the first run ascending, and return its length: until CPython 3.12. */
MAYBE_UNUSED static int strict_run(const double *keys, int *order, int n)
{
    int end = 2, descending = LESS(1, 0);
    while (end < n && LESS(end, end - 1) == descending) {
        end++;
    }
    if (descending) {
        reverse(order, order + end);
    }
    return end;
}

/* The same since CPython 3.13: items of a descending run may be equal, and keep their order. */
MAYBE_UNUSED static int run_with_ties(const double *keys, int *order, int n)
{
    int end = 1, equal = 0;
    while (end < n && !LESS(end, end - 1)) {
        end++;
    }
    if (end == n || LESS(0, end - 1)) {
        return end;
    }
    reverse(order, order + end);
    for (end++; end < n && !LESS(end - 1, end); end++) {
        equal++;
        if (LESS(end, end - 1)) {
            reverse(order + end - equal, order + end);
            equal = 0;
        }
    }
    reverse(order + end - equal - 1, order + end);
    reverse(order, order + end);
    while (end < n && !LESS(end, end - 1)) {
        end++;
    }
    return end;
}

#undef LESS

/* Number of the item that sorted() puts into a place; `ties`: as since CPython 3.13. */
MAYBE_UNUSED static double sorted_item(int place, int ties, int n, const double *keys)
{
    int order[MOST_SORTED];
    for (int k = 0; k < n; k++) {
        order[k] = k;
    }
    for (int end = ties ? run_with_ties(keys, order, n) : strict_run(keys, order, n); end < n; end++) {
        int number = order[end], low = 0, high = end;
        while (low < high) {
            int middle = (low + high) / 2;
            if (keys[number] < keys[order[middle]]) {
                high = middle;
            } else {
                low = middle + 1;
            }
        }
        memmove(order + low + 1, order + low, (size_t)(end - low) * sizeof *order);
        order[low] = number;
    }
    return order[place];
}

/* Index in `count` items, counted from the beginning; -1 if it is out of range, -2 if it is too large for Python. */
MAYBE_UNUSED static double place_in(double index, double count)
{
    if (!(index >= -0x1p63 && index < 0x1p63)) {
        return -2.0;
    }
    index = index < 0.0 ? index + count : index;
    return index >= 0.0 && index < count ? index : -1.0;
}

/* ---- growing lists: ring buffers of items with a fixed number of doubles ---- */

typedef struct {
    double *items;
    size_t first, count, capacity;
} List;

MAYBE_UNUSED static double *item(const List *list, int width, double index)
{
    size_t place = list->first + (size_t)index;
    return list->items + (place < list->capacity ? place : place - list->capacity) * (size_t)width;
}

/* Append an item; false if out of memory. */
MAYBE_UNUSED static int push(List *list, int width, const void *numbers)
{
    size_t size = (size_t)width * sizeof(double);
    if (list->count == list->capacity) {
        size_t capacity = list->capacity > 0 ? 2 * list->capacity : 8;
        double *items = malloc(capacity * size);
        if (items == NULL) {
            return 0;
        }
        for (size_t i = 0; i < list->count; i++) {
            memcpy(items + i * (size_t)width, item(list, width, (double)i), size);
        }
        free(list->items);
        *list = (List){items, 0, list->count, capacity};
    }
    memcpy(item(list, width, (double)list->count++), numbers, size);
    return 1;
}

MAYBE_UNUSED static void replace(List *list, double index, int width, const double *numbers)
{
    memcpy(item(list, width, index), numbers, (size_t)width * sizeof *numbers);
}

MAYBE_UNUSED static void drop(List *list, int every)
{
    if (every) {
        list->first = list->count = 0;
    } else {
        list->first = list->first + 1 < list->capacity ? list->first + 1 : 0;
        list->count--;
    }
}

/* ---- texts ---- */

typedef struct {
    const char *kind, *where;
    char text[2048];
    size_t length;
} Problem;

static void say(Problem *problem, const char *text)
{
    size_t room = sizeof problem->text - 1 - problem->length, length = strlen(text);
    length = length < room ? length : room;
    memcpy(problem->text + problem->length, text, length);
    problem->length += length;
    problem->text[problem->length] = '\0';
}

MAYBE_UNUSED static void begin_problem(Problem *problem, const char *kind, const char *where)
{
    problem->kind = kind, problem->where = where;
    problem->length = 0, problem->text[0] = '\0';
}

/* ---- branches that were compared with Python ----
 *
 * The generated file has a table of its branches. In the comparison at the build, `closed` is 0 and each branch is
 * noted when it is reached. The build then writes what was reached into the library, behind MARK. Where the table is
 * closed, a branch that was never compared ends the call, and its caller goes on in Python. */

#define MARK "branches that yawbench compared:"

#define REACHED(k)                                                                                          \
    if (!branches.reached[k] && !may_go_on(problem, branches.closed, &branches.reached[k], BRANCHES[k])) {  \
        return 1;                                                                                           \
    }

#if defined __GNUC__ && !defined __clang__
__attribute__((cold, noinline))
#endif
MAYBE_UNUSED static int may_go_on(Problem *problem, int closed, unsigned char *reached, const char *where)
{
    if (!closed) {
        *reached = 1;
        return 1;
    }
    begin_problem(problem, "RuntimeError", where);
    say(problem, UNTRIED);
    return 0;
}

/* Give the comparison the table, and the files and lines of its branches. */
#define BRANCHES_OF_LIBRARY                                                                                 \
    SHOWN unsigned char *yawbench_branches(int *count, const char *const **places);                         \
    SHOWN unsigned char *yawbench_branches(int *count, const char *const **places)                          \
    {                                                                                                       \
        *count = N_BRANCHES;                                                                                \
        *places = BRANCHES;                                                                                 \
        return branches.reached;                                                                            \
    }
#if defined _WIN32
#define SHOWN
#else
#define SHOWN __attribute__((visibility("default")))
#endif

/* Write a number with some digits: exponents from `widest` on, and below -4, use exponential notation; ".0" if
 * `real`. printf and strtod only process each other's text, so the locale's decimal point does not matter. */
static void write_digits(char *out, double x, int digits, int widest, int real)
{
    char text[40], *end = out, found[24];
    int n = 0, exponent;
    if (!isfinite(x)) {
        strcpy(out, isnan(x) ? "nan" : x > 0.0 ? "inf" : "-inf");
        return;
    }
    snprintf(text, sizeof text, "%.*e", digits - 1, x);
    for (const char *c = text; *c != 'e'; c++) {
        if (*c >= '0' && *c <= '9' && n < 20) {
            found[n++] = *c;
        }
    }
    exponent = atoi(strchr(text, 'e') + 1);
    while (n > 1 && found[n - 1] == '0') {
        n--;
    }
    if (signbit(x)) {
        *end++ = '-';
    }
    if (exponent < -4 || exponent >= widest) {
        *end++ = found[0];
        if (n > 1) {
            *end++ = '.';
            memcpy(end, found + 1, (size_t)n - 1), end += n - 1;
        }
        sprintf(end, "e%c%02d", exponent < 0 ? '-' : '+', abs(exponent));
        return;
    }
    if (exponent < 0) {
        *end++ = '0', *end++ = '.';
        for (int i = -1; i > exponent; i--) {
            *end++ = '0';
        }
        memcpy(end, found, (size_t)n), end += n;
    } else {
        for (int i = 0; i <= exponent; i++) {
            *end++ = i < n ? found[i] : '0';
        }
        if (n > exponent + 1) {
            *end++ = '.';
            memcpy(end, found + exponent + 1, (size_t)(n - exponent - 1)), end += n - exponent - 1;
        } else if (real) {
            *end++ = '.', *end++ = '0';
        }
    }
    *end = '\0';
}

/* repr() of a float: the shortest text that reads back as the same float. */
static void write_repr(char *out, double x)
{
    char text[40];
    int digits = 1;
    for (; digits < 17; digits++) {
        snprintf(text, sizeof text, "%.*e", digits - 1, x);
        if (strtod(text, NULL) == x) {
            break;
        }
    }
    write_digits(out, x, digits, 16, 1);
}

/* A number with some digits, as in :.6g; 0: as repr(). */
MAYBE_UNUSED static void say_real(Problem *problem, double x, int digits)
{
    char text[64];
    if (digits == 0) {
        write_repr(text, x);
    } else {
        write_digits(text, x, digits, digits, 0);
    }
    say(problem, text);
}

MAYBE_UNUSED static int write_integer(char *out, double x)
{
    return sprintf(out, "%.0f", x);
}

MAYBE_UNUSED static void say_integer(Problem *problem, double x)
{
    char text[400];
    snprintf(text, sizeof text, "%.0f", x);
    say(problem, text);
}
