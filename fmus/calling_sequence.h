/* Calling sequence of FMI 2.0 and 3.0, and the time of an instance, for the launcher, native libraries and components
 * in C. A refused call does not change the instance. */
#ifndef YAWBENCH_CALLING_SEQUENCE_H
#define YAWBENCH_CALLING_SEQUENCE_H

#include <math.h>
#include <stdio.h>

enum { BEFORE_INITIALIZATION, DURING_INITIALIZATION, AFTER_INITIALIZATION, AFTER_TERMINATE };

#define LONGEST_STEP 86400.0 /* [s]; chosen: a day. Units compute thousands of inner steps per second. */
#define LATEST_START 1e12 /* [s]; chosen: up to here, periods of a thousandth of a second still advance the time */

typedef struct {
    int phase;
    int failed; /* an error has been logged since the last reset */
    int stop_defined;
    double time; /* reached [s] */
    double stop; /* [s] */
} Progress;

typedef struct {
    char text[192];
} Refusal;

/* Tolerance for the times of hosts, which compute them by sums, products or from integer nanoseconds. A hundredth
 * of the step is far above their errors, and far below an extra step. */
static inline double time_tolerance(const Progress *at, double h)
{
    return 0.01 * h + 1e-12 * fabs(at->time);
}

static inline int not_allowed(const Progress *at, const char *call, Refusal *why)
{
    static const char *const when[] = {"before initialization", "during initialization", "after initialization",
                                       "after it was terminated"};
    snprintf(why->text, sizeof why->text, "%s is not allowed %s", call, when[at->phase]);
    return 0;
}

/* Write a refusal of a call with one or two numbers, with a decimal point in every locale. */
static inline int refuse_times(Refusal *why, const char *call, const char *format, double x, double y)
{
    int length = snprintf(why->text, sizeof why->text, "%s", call);
    snprintf(why->text + length, sizeof why->text - (size_t)length, format, x, y);
    for (char *c = why->text; *c != '\0'; c++) {
        if (*c == ',') {
            *c = '.';
        }
    }
    return 0;
}

/* Register a call that changes the phase; 0 with the reason if it is not allowed now. */
static inline int pass_on(Progress *at, int from, int to, const char *call, Refusal *why)
{
    if (at->phase != from) {
        return not_allowed(at, call, why);
    }
    at->phase = to;
    return 1;
}

static inline int set_up(Progress *at, const char *call, double start, int stop_defined, double stop, Refusal *why)
{
    if (at->phase != BEFORE_INITIALIZATION) {
        return not_allowed(at, call, why);
    }
    if (!(fabs(start) <= LATEST_START)) {
        return refuse_times(why, call, ": the start time must be within %.9g s of 0 (got %.9g s)", LATEST_START,
                            start);
    }
    at->time = start, at->stop_defined = stop_defined != 0, at->stop = stop;
    return 1;
}

/* Hosts also terminate instances that failed in initialization. */
static inline int terminate(Progress *at, const char *call, Refusal *why)
{
    if (at->phase == AFTER_TERMINATE) {
        return not_allowed(at, call, why);
    }
    at->phase = AFTER_TERMINATE;
    return 1;
}

/* 1 if the instance may step from t to t + h [s], 0 with the reason if not. */
static inline int may_step(const Progress *at, const char *call, double t, double h, Refusal *why)
{
    if (at->phase != AFTER_INITIALIZATION) {
        return not_allowed(at, call, why);
    }
    if (!(h > 0.0 && h <= LONGEST_STEP)) {
        return refuse_times(why, call, ": the step must be positive and at most %.9g s (got %.9g s)", LONGEST_STEP, h);
    }
    double tolerance = time_tolerance(at, h);
    if (!(fabs(t - at->time) <= tolerance)) {
        return refuse_times(why, call, " at t = %.9g s: the instance has reached t = %.9g s", t, at->time);
    }
    if (at->stop_defined && t + h > at->stop + tolerance) {
        return refuse_times(why, call, " to t = %.9g s: the stop time is %.9g s", t + h, at->stop);
    }
    return 1;
}

#endif
