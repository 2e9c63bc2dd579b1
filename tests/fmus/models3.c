/* Small models as FMI 3.0 co-simulation FMUs; the instantiation token says which one an instance is.
 *
 * All integrate with explicit Euler steps of 0.01 s inside, and pass every type of FMI 3.0 through but Binary.
 * Functions that nothing here needs are in stubs.h, which the tests write: fmpy wants every one to exist. */
#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "stubs.h"

#define EXPORT __attribute__((visibility("default")))
#define INSIDE 0.01

enum { OK, WARNING, DISCARD, ERROR, FATAL };
typedef uint32_t Reference;
typedef const char *Text;
typedef void Logger(void *environment, int status, Text category, Text message);

typedef struct {
    char model[32];
    void *environment;
    Logger *log;
    double time, limit;
    /* every type: [0] in, [1] out */
    double f64[2];
    float f32[2];
    int8_t i8[2];
    uint8_t u8[2];
    int16_t i16[2];
    uint16_t u16[2];
    int32_t i32[2];
    uint32_t u32[2];
    int64_t i64[2], mode[2];
    uint64_t u64[2], size, wanted, length; /* of Sized: as told, and as of the last configuration mode */
    bool flag[2];
    char text[2][64];
    /* states and parameters of the others */
    double x[2], p[2], matrix[4], u[2], y[2], v[16], w[16], k;
    int32_t counter;
} Instance;

#define EACH_TYPE(X)                                                                                        \
    X(Float64, double, 1, f64) X(Float32, float, 3, f32) X(Int8, int8_t, 5, i8) X(UInt8, uint8_t, 7, u8)    \
    X(Int16, int16_t, 9, i16) X(UInt16, uint16_t, 11, u16) X(Int32, int32_t, 13, i32)                       \
    X(UInt32, uint32_t, 15, u32) X(Int64, int64_t, 17, i64) X(UInt64, uint64_t, 19, u64)                    \
    X(Boolean, bool, 21, flag)

/* Return where the FMU keeps a variable of a C type, and its number of elements. */
#define FIND(Type, c_type, first, field)                                                                    \
    static c_type *find##Type(Instance *in, Reference r, size_t *n)                                         \
    {                                                                                                       \
        *n = 1;                                                                                             \
        if (r == first || r == first + 1) {                                                                 \
            return &in->field[r - first];                                                                   \
        }                                                                                                   \
        return more##Type(in, r, n);                                                                        \
    }

static double *moreFloat64(Instance *in, Reference r, size_t *n)
{
    double *scalars[] = {&in->x[0], &in->x[1], &in->p[0], &in->p[1]};
    if (r == 0) {
        return &in->time;
    }
    if (r >= 31 && r <= 34) {
        return scalars[r - 31];
    }
    if (r == 51 || r == 52) {
        *n = in->length;
        return r == 51 ? in->v : in->w;
    }
    if (r == 53) {
        return &in->k;
    }
    *n = r == 41 ? 4 : 2;
    return r == 41 ? in->matrix : r == 42 ? in->u : r == 43 ? in->y : NULL;
}
static int32_t *moreInt32(Instance *in, Reference r, size_t *n) { return r == 35 ? &in->counter : NULL; }
static int64_t *moreInt64(Instance *in, Reference r, size_t *n)
{
    return r == 25 || r == 26 ? &in->mode[r - 25] : NULL;
}
static uint64_t *moreUInt64(Instance *in, Reference r, size_t *n)
{
    return r == 40 ? &in->size : r == 50 ? &in->wanted : NULL;
}
#define NO_MORE(Type, c_type) \
    static c_type *more##Type(Instance *in, Reference r, size_t *n) { return NULL; }
NO_MORE(Float32, float)
NO_MORE(Int8, int8_t)
NO_MORE(UInt8, uint8_t)
NO_MORE(Int16, int16_t)
NO_MORE(UInt16, uint16_t)
NO_MORE(UInt32, uint32_t)
NO_MORE(Boolean, bool)
EACH_TYPE(FIND)

static bool is(const Instance *in, Text model) { return strcmp(in->model, model) == 0; }

static void update(Instance *in)
{
#define PASS(Type, c_type, first, field) in->field[1] = in->field[0];
    EACH_TYPE(PASS)
    in->mode[1] = in->mode[0];
    for (size_t i = 0; i < in->length; i++) {
        in->w[i] = in->k * in->v[i];
    }
    snprintf(in->text[1], sizeof in->text[1], "<%s>", in->text[0]);
    for (int i = 0; i < 2; i++) {
        in->y[i] = in->matrix[2 * i] * in->u[0] + in->matrix[2 * i + 1] * in->u[1];
    }
}

#define ACCESS(Type, c_type, first, field)                                                                  \
    static int copy##Type(Instance *in, const Reference r[], size_t n, c_type v[], size_t count, bool set)  \
    {                                                                                                       \
        size_t at = 0, elements;                                                                            \
        for (size_t i = 0; i < n; i++, at += elements) {                                                    \
            c_type *place = find##Type(in, r[i], &elements);                                                \
            if (!place || at + elements > count) {                                                          \
                in->log(in->environment, ERROR, "", "no such " #Type);                                      \
                return ERROR;                                                                               \
            }                                                                                               \
            memcpy(set ? place : v + at, set ? v + at : place, elements * sizeof *v);                       \
        }                                                                                                   \
        return at == count ? OK : ERROR;                                                                    \
    }                                                                                                       \
    EXPORT int fmi3Set##Type(void *c, const Reference r[], size_t n, const c_type v[], size_t count)        \
    {                                                                                                       \
        return copy##Type(c, r, n, (c_type *)v, count, true);                                               \
    }                                                                                                       \
    EXPORT int fmi3Get##Type(void *c, const Reference r[], size_t n, c_type v[], size_t count)              \
    {                                                                                                       \
        update(c);                                                                                          \
        return copy##Type(c, r, n, v, count, false);                                                        \
    }
EACH_TYPE(ACCESS)

EXPORT int fmi3SetString(void *c, const Reference r[], size_t n, const Text v[], size_t count)
{
    Instance *in = c;
    for (size_t i = 0; i < n; i++) {
        if (r[i] != 23) {
            return ERROR;
        }
        snprintf(in->text[0], sizeof in->text[0], "%s", v[i]);
    }
    return OK;
}

EXPORT int fmi3GetString(void *c, const Reference r[], size_t n, Text v[], size_t count)
{
    Instance *in = c;
    update(in);
    for (size_t i = 0; i < n; i++) {
        v[i] = in->text[r[i] == 24];
    }
    return OK;
}

EXPORT void *fmi3InstantiateCoSimulation(Text name, Text token, Text resources, bool visible, bool logging,
                                         bool events, bool early, const Reference *needed, size_t n,
                                         void *environment, Logger *log, void *intermediate)
{
    size_t length = resources ? strlen(resources) : 0;
    if (strcmp(token, "Refusing") == 0 || events || !length || resources[length - 1] != '/') {
        log(environment, ERROR, "", "no licence; 100%s of them are taken");
        return NULL;
    }
    Instance *in = calloc(1, sizeof *in);
    snprintf(in->model, sizeof in->model, "%s", token);
    in->environment = environment;
    in->log = log;
    in->size = 2;
    in->wanted = in->length = 3;
    in->k = 1;
    in->x[0] = is(in, "VanDerPol") ? 2 : 1;
    in->p[0] = is(in, "BouncingBall") ? -9.81 : 1;
    in->p[1] = 0.7;
    in->counter = 1;
    in->matrix[0] = in->matrix[3] = 1;
    return in;
}

EXPORT void fmi3FreeInstance(void *c) { free(c); }

EXPORT int fmi3ExitConfigurationMode(void *c)
{
    Instance *in = c;
    in->length = in->wanted;
    return in->length <= 16 ? OK : ERROR;
}

EXPORT int fmi3EnterInitializationMode(void *c, bool tolerant, double tolerance, double start, bool stops, double stop)
{
    Instance *in = c;
    in->time = start;
    if (is(in, "Deaf")) {
        in->p[0] = 1;
    }
    return OK;
}

static void step(Instance *in, double h)
{
    double a = in->x[0], b = in->x[1];
    if (is(in, "Dahlquist")) {
        in->x[0] -= h * in->p[0] * a;
    } else if (is(in, "VanDerPol")) {
        in->x[0] += h * b;
        in->x[1] += h * (in->p[0] * (1 - a * a) * b - a);
    } else if (is(in, "BouncingBall")) {
        in->x[0] += h * b;
        in->x[1] += h * in->p[0];
        if (in->x[0] < 0) {
            in->x[0] = 0;
            in->x[1] *= -in->p[1];
        }
    }
}

EXPORT int fmi3DoStep(void *c, double t, double h, bool keep, bool *event, bool *ended, bool *early, double *reached)
{
    Instance *in = c;
    *event = *ended = *early = false;
    double end = t + h;
    if (is(in, "Early") && h > 1.5 * INSIDE) {
        *early = true;
        end = t + INSIDE;
    }
    if (is(in, "Stuck")) {
        *early = true;
        end = t;
    }
    for (long i = lround(t / INSIDE); i < lround(end / INSIDE); i++) {
        step(in, INSIDE);
    }
    in->x[1] += is(in, "Early") ? end - t : 0;
    in->time = *reached = end;
    if (is(in, "Stair")) {
        in->counter = 1 + (int)floor(end + 1e-9);
        *ended = in->counter >= 10;
    }
    return OK;
}

#define ALWAYS_OK(Name) \
    EXPORT int fmi3##Name(void *c) { return OK; }
ALWAYS_OK(EnterConfigurationMode)
ALWAYS_OK(ExitInitializationMode)
ALWAYS_OK(Terminate)
ALWAYS_OK(Reset)
EXPORT Text fmi3GetVersion(void) { return "3.0"; }
