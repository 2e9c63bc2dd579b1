/* A co-simulation FMU without Python: doubles its inputs, answers the step at 0.25 s as it is told.
 *
 * Its GUID says how it treats the parameter: {reset} forgets it when the experiment is set up, {deaf} takes
 * nothing, {mute} does not tell it; {whole} and {half} want to end the run in the step at 0.25 s, having done
 * all or half of it; {solver} gives start time and tolerance as its Real output; {hang NAME} never returns from
 * the first call of fmi2NAME. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "fmi2.h"

#define EXPORT __attribute__((visibility("default")))
#define INPUT 1000001u      /* value references are large and sparse */
#define OUTPUT 4000000000u
#define ANSWER 7u
#define AT_THE_END 100      /* added to the answer: fmi2Terminate gives it, not the step */

typedef struct {
    fmi2CallbackFunctions host;
    char name[64];
    double real, reached, solver;
    int done;
    int integer, boolean, answer;
    char given[64], made[80], guid[48];
} Instance;

static void perhaps_hang(const char *guid, const char *function)
{
    char wanted[48];
    snprintf(wanted, sizeof wanted, "{hang %s}", function);
    while (!strcmp(guid, wanted)) {
        pause();
    }
}

EXPORT int counters[3]; /* instantiated, terminated, freed */

EXPORT fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                                     const fmi2CallbackFunctions *host, fmi2Boolean visible, fmi2Boolean logging)
{
    (void)type, (void)visible, (void)logging;
    if (strcmp(guid, "{refuse}") == 0) {
        host->logger(host->componentEnvironment, name, fmi2Error, "logStatusError", "no licence in %s", "the shop");
        return NULL;
    }
    perhaps_hang(guid, "Instantiate");
    if (strncmp(resources, "file:///", 8) != 0) {
        return NULL;
    }
    Instance *in = host->allocateMemory(1, sizeof *in);
    in->host = *host;
    snprintf(in->name, sizeof in->name, "%s", name);
    snprintf(in->guid, sizeof in->guid, "%s", guid);
    counters[0]++;
    return in;
}

EXPORT void fmi2FreeInstance(fmi2Component c)
{
    Instance *in = c;
    counters[2]++;
    in->host.freeMemory(in);
}

EXPORT fmi2Status fmi2Terminate(fmi2Component c)
{
    const Instance *in = c;
    counters[1]++;
    return in->answer >= AT_THE_END ? in->answer - AT_THE_END : fmi2OK;
}

EXPORT fmi2Status fmi2DoStep(fmi2Component c, fmi2Real t, fmi2Real h, fmi2Boolean keep)
{
    (void)keep;
    Instance *in = c;
    if (!strcmp(in->guid, "{whole}") || !strcmp(in->guid, "{half}")) {
        in->reached = t + (!strcmp(in->guid, "{whole}") ? h : h / 2);
        in->done = t > 0.249;
        return in->done ? fmi2Discard : fmi2OK;
    }
    if (!strcmp(in->guid, "{chatty}")) {
        in->host.logger(in->host.componentEnvironment, in->name, fmi2OK, "steps", "at %g", t);
    }
    if (t < 0.249 || t > 0.251 || in->answer == fmi2OK || in->answer >= AT_THE_END) {
        return fmi2OK;
    }
    in->host.logger(in->host.componentEnvironment, in->name, in->answer, "events",
                    "valve %d of %s is %.1f%% open, größer als %s", 3, in->name, 99.5, "gedacht");
    return in->answer;
}

#define EXCHANGE(Type, set, get, given)                                                                            \
    EXPORT fmi2Status fmi2Set##Type(fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2##Type v[]) \
    {                                                                                                       \
        Instance *in = c;                                                                                   \
        perhaps_hang(in->guid, "Set" #Type);                                                                \
        for (size_t i = 0; i < n; i++) {                                                                    \
            if (r[i] == INPUT) {                                                                            \
                set;                                                                                        \
            } else if (r[i] == ANSWER) {                                                                    \
                in->answer = strcmp(in->guid, "{deaf}") ? (int)(size_t)v[i] : 0;                            \
            } else {                                                                                        \
                return fmi2Error;                                                                           \
            }                                                                                               \
        }                                                                                                   \
        return fmi2OK;                                                                                      \
    }                                                                                                       \
    EXPORT fmi2Status fmi2Get##Type(fmi2Component c, const fmi2ValueReference r[], size_t n, fmi2##Type v[]) \
    {                                                                                                       \
        Instance *in = c;                                                                                   \
        for (size_t i = 0; i < n; i++) {                                                                    \
            if (r[i] == ANSWER && strcmp(in->guid, "{mute}")) {                                             \
                v[i] = (fmi2##Type)(size_t)in->answer;                                                      \
            } else if (r[i] == OUTPUT) {                                                                    \
                get;                                                                                        \
            } else if (r[i] == INPUT) {                                                                     \
                given;                                                                                      \
            } else {                                                                                        \
                in->host.logger(in->host.componentEnvironment, in->name, fmi2Error, "", "no such output");  \
                return fmi2Error;                                                                           \
            }                                                                                               \
        }                                                                                                   \
        return fmi2OK;                                                                                      \
    }

EXCHANGE(Integer, in->integer = v[i], v[i] = 2 * in->integer, v[i] = in->integer)
EXCHANGE(Boolean, in->boolean = v[i], v[i] = !in->boolean, v[i] = in->boolean)
#ifndef BARE
EXCHANGE(String, snprintf(in->given, sizeof in->given, "%s", v[i]),
         (snprintf(in->made, sizeof in->made, "<%s>", in->given), v[i] = in->made),
         v[i] = in->given)
#endif

EXPORT fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2Real v[])
{
    if (n != 1 || r[0] != INPUT) {
        return fmi2Error;
    }
    perhaps_hang(((Instance *)c)->guid, "SetReal");
    ((Instance *)c)->real = v[0];
    return fmi2OK;
}

EXPORT fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference r[], size_t n, fmi2Real v[])
{
    const Instance *in = c;
    for (size_t i = 0; i < n; i++) {
        if (r[i] != OUTPUT && r[i] != INPUT) {
            return fmi2Error;
        }
        v[i] = (r[i] == OUTPUT ? 2 : 1) * in->real;
        if (r[i] == OUTPUT && !strcmp(in->guid, "{solver}")) {
            v[i] = in->solver;
        }
    }
    return fmi2OK;
}

EXPORT fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean tolerant, fmi2Real tolerance, fmi2Real start,
                                      fmi2Boolean stops, fmi2Real stop)
{
    (void)stops, (void)stop;
    Instance *in = c;
    perhaps_hang(in->guid, "SetupExperiment");
    in->solver = tolerant ? start + tolerance : start;
    if (strcmp(in->guid, "{reset}") == 0) {
        in->answer = 0;
    }
    return fmi2OK;
}

EXPORT fmi2Status fmi2GetBooleanStatus(fmi2Component c, fmi2StatusKind kind, fmi2Boolean *value)
{
    *value = kind == 3 && ((Instance *)c)->done; /* terminated */
    return fmi2OK;
}

EXPORT fmi2Status fmi2GetRealStatus(fmi2Component c, fmi2StatusKind kind, fmi2Real *value)
{
    *value = kind == 2 ? ((Instance *)c)->reached : 0; /* last successful time */
    return fmi2OK;
}

EXPORT fmi2Status fmi2EnterInitializationMode(fmi2Component c)
{
    perhaps_hang(((Instance *)c)->guid, "EnterInitializationMode");
    return fmi2OK;
}

EXPORT fmi2Status fmi2ExitInitializationMode(fmi2Component c)
{
    perhaps_hang(((Instance *)c)->guid, "ExitInitializationMode");
    return fmi2OK;
}

#ifndef BARE /* without what many leave out */
#include "idle.h"
#endif
