/* The functions of FMI 3.0, for fmi_unit.h.
 *
 * Value references are those of FMI 2.0 plus 1, so that they are the positions of variables in the model description
 * counted from 1: OMSimulator 3.0 takes the references in ModelStructure for such positions. The last variable is the
 * time, which FMI 3.0 demands. */
#include "fmi3.h"

enum { FIRST = 1, TIME = FIRST + N_VARIABLES };

static void send_3(const Host *host, const char *name, const char *category, const char *text)
{
    (void)name;
    ((fmi3LogMessageCallback)host->logger)(host->environment, fmi3Error, category, text);
}

EXPORTED const char *fmi3GetVersion(void)
{
    return "3.0";
}

EXPORTED fmi3Instance fmi3InstantiateCoSimulation(
    fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible, fmi3Boolean logging_on,
    fmi3Boolean event_mode, fmi3Boolean early_return, const fmi3ValueReference required[], size_t n_required,
    fmi3InstanceEnvironment environment, fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback update)
{
    Host host = {send_3, (void (*)(void))log, environment, FIRST};
    (void)resources, (void)visible, (void)logging_on, (void)event_mode, (void)early_return, (void)required;
    (void)n_required, (void)update;
    return make(host, "fmi3InstantiateCoSimulation", name, token, NULL);
}

EXPORTED fmi3Instance fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String resources,
                                                   fmi3Boolean visible, fmi3Boolean logging_on,
                                                   fmi3InstanceEnvironment environment, fmi3LogMessageCallback log)
{
    Host host = {send_3, (void (*)(void))log, environment, FIRST};
    (void)resources, (void)visible, (void)logging_on;
    return make(host, "fmi3InstantiateModelExchange", name, token, ONLY_CO_SIMULATION);
}

EXPORTED fmi3Instance fmi3InstantiateScheduledExecution(
    fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible, fmi3Boolean logging_on,
    fmi3InstanceEnvironment environment, fmi3LogMessageCallback log, fmi3ClockUpdateCallback update,
    fmi3LockPreemptionCallback lock, fmi3UnlockPreemptionCallback unlock)
{
    (void)update, (void)lock, (void)unlock;
    return fmi3InstantiateModelExchange(name, token, resources, visible, logging_on, environment, log);
}

EXPORTED void fmi3FreeInstance(fmi3Instance c)
{
    discard(c);
}

#define FMI3(name, parameters, answer) ANSWER(fmi3, name, parameters, answer)
FUNCTIONS_OF_BOTH(fmi3, FMUState, Deserialize)

FMI3(EnterInitializationMode,
     (fmi3Instance c, fmi3Boolean tolerance_defined, fmi3Float64 tolerance, fmi3Float64 start, fmi3Boolean stop_defined,
      fmi3Float64 stop),
     ((void)tolerance_defined, (void)tolerance,
      set_times(instance, call, start, stop_defined, stop) == OK ? enter_initialization(instance, call) : ERROR))

EXPORTED fmi3Status fmi3DoStep(fmi3Instance c, fmi3Float64 t, fmi3Float64 h, fmi3Boolean keep, fmi3Boolean *event,
                               fmi3Boolean *ends, fmi3Boolean *early, fmi3Float64 *reached)
{
    Instance *instance = c;
    (void)keep;
    if (instance == NULL) {
        return fmi3Error;
    }
    Status status = step(instance, "fmi3DoStep", t, h);
    fmi3Boolean *const never[] = {event, ends, early};
    for (size_t i = 0; i < sizeof never / sizeof *never; i++) {
        if (never[i] != NULL) {
            *never[i] = 0;
        }
    }
    if (reached != NULL) {
        *reached = instance->now.content.at.time;
    }
    return (fmi3Status)status;
}

/* All variables are scalars. */
static Status has_values(const Instance *instance, const char *call, const void *r, size_t n, const void *values,
                         size_t n_values)
{
    return n > 0 && (r == NULL || values == NULL) ? complain_of(instance, call, "value references or values are missing")
           : n != n_values ? complain_of(instance, call, "there must be a value for each reference, all are scalars")
                           : OK;
}

EXPORTED fmi3Status fmi3GetFloat64(fmi3Instance c, const fmi3ValueReference r[], size_t n, fmi3Float64 values[], size_t m)
{
    Instance *instance = c;
    if (instance == NULL || has_values(instance, "fmi3GetFloat64", r, n, values, m) != OK) {
        return fmi3Error;
    }
    for (size_t i = 0; i < n; i++) {
        if (r[i] == TIME) {
            Status before = get_reals(instance, "Float64", r, i, values);
            Status after = get_reals(instance, "Float64", r + i + 1, n - i - 1, values + i + 1);
            values[i] = instance->now.content.at.time;
            return (fmi3Status)(before != OK ? before : after);
        }
    }
    return (fmi3Status)get_reals(instance, "Float64", r, n, values);
}

FMI3(SetFloat64, (fmi3Instance c, const fmi3ValueReference r[], size_t n, const fmi3Float64 values[], size_t m),
     has_values(instance, call, r, n, values, m) != OK ? ERROR : set_reals(instance, "Float64", r, n, values))

static int within_int(int64_t value)
{
    return value > INT32_MAX ? INT32_MAX : value < INT32_MIN ? INT32_MIN : (int)value;
}

#define GET_AND_SET(type, kinds, in, blank)                                                                 \
    EXPORTED fmi3Status fmi3Get##type(fmi3Instance c, const fmi3ValueReference r[], size_t n,               \
                                      fmi3##type values[], size_t m)                                        \
    {                                                                                                       \
        Instance *instance = c;                                                                             \
        Status status = instance == NULL ? ERROR : has_values(instance, "fmi3Get" #type, r, n, values, m);  \
        for (size_t i = 0; i < n && status == OK; i++) {                                                    \
            int value = 0;                                                                                  \
            status = get_others(instance, kinds, #type, r + i, 1, &value);                                  \
            values[i] = blank;                                                                              \
        }                                                                                                   \
        return (fmi3Status)status;                                                                          \
    }                                                                                                       \
    EXPORTED fmi3Status fmi3Set##type(fmi3Instance c, const fmi3ValueReference r[], size_t n,               \
                                      const fmi3##type values[], size_t m)                                  \
    {                                                                                                       \
        Instance *instance = c;                                                                             \
        Status status = instance == NULL ? ERROR : has_values(instance, "fmi3Set" #type, r, n, values, m);  \
        for (size_t i = 0; i < n && status == OK; i++) {                                                    \
            int value = in;                                                                                 \
            status = set_others(instance, kinds, #type, r + i, 1, &value);                                  \
        }                                                                                                   \
        return (fmi3Status)status;                                                                          \
    }
GET_AND_SET(Int32, INTEGERS, values[i], value)
GET_AND_SET(Int64, ENUMERATIONS, within_int(values[i]), value)
GET_AND_SET(Boolean, BOOLEANS, values[i], value != 0)
GET_AND_SET(String, TEXTS, 0, "")
#define NO_VARIABLES(type) GET_AND_SET(type, TEXTS, 0, 0)
FMI3_OTHER_TYPES(NO_VARIABLES)
#undef NO_VARIABLES
#undef GET_AND_SET

#define UNSUPPORTED(name, parameters) FMI3(name, parameters, complain(instance, "fmi3" #name " is not supported"))
FMI3_UNSUPPORTED_FUNCTIONS(UNSUPPORTED)
#undef UNSUPPORTED
