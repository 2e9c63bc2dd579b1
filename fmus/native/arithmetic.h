/* Run-time library of translated components: CPython's arithmetic, and which branches were compared with it. */
#include "unit_parts.h"

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
