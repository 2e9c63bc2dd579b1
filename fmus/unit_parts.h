/* Parts of every unit in C: declarations of variables, growing lists, texts of exceptions. */
#ifndef YAWBENCH_UNIT_PARTS_H
#define YAWBENCH_UNIT_PARTS_H

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

enum { REAL, INTEGER, BOOLEAN, ENUMERATION };
enum { INPUT, OUTPUT, PARAMETER };

/* Declaration of a variable; `place` is its offset in Variables. A tunable one is set after initialization, too. */
typedef struct {
    const char *name;
    int type, causality, tunable;
    size_t place;
    double start, min, max;
    const char *const *choices;
    int n_choices;
} Declared;

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

#endif
