/* The functions of FMI 2.0, for fmi_unit.h. */
#include "fmi2.h"

/* A host may print a text with printf, so '%' is doubled. */
static void send_2(const Host *host, const char *name, const char *category, const char *text)
{
    char *safe = malloc(2 * strlen(text) + 1), *end = safe;
    if (safe == NULL) {
        return;
    }
    for (const char *c = text; *c != '\0'; c++) {
        *end++ = *c;
        if (*c == '%') {
            *end++ = '%';
        }
    }
    *end = '\0';
    ((fmi2Logger *)host->logger)(host->environment, name, fmi2Error, category, safe);
    free(safe);
}

EXPORTED const char *fmi2GetTypesPlatform(void)
{
    return "default";
}

EXPORTED const char *fmi2GetVersion(void)
{
    return "2.0";
}

EXPORTED fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                                       const fmi2CallbackFunctions *host, fmi2Boolean visible, fmi2Boolean logging_on)
{
    (void)resources, (void)visible, (void)logging_on;
    if (host == NULL) {
        return NULL;
    }
    Host known = {send_2, (void (*)(void))host->logger, host->componentEnvironment, 0};
    return make(known, "fmi2Instantiate", name, guid, type == fmi2CoSimulation ? NULL : ONLY_CO_SIMULATION);
}

EXPORTED void fmi2FreeInstance(fmi2Component c)
{
    discard(c);
}

/* A function that answers with a status: its name, parameters, and what it returns for an instance. */
#define FMI2(name, parameters, answer)                                                                      \
    EXPORTED fmi2Status fmi2##name parameters                                                               \
    {                                                                                                       \
        const char *const call = "fmi2" #name;                                                              \
        Instance *instance = c;                                                                             \
        (void)call;                                                                                         \
        return instance == NULL ? fmi2Error : (fmi2Status)(answer);                                         \
    }
#define VALUES(answer)                                                                                      \
    (n > 0 && (r == NULL || values == NULL) ? complain_of(instance, call, "value references or values are missing") \
                                            : (answer))

FMI2(SetupExperiment,
     (fmi2Component c, fmi2Boolean tolerance_defined, fmi2Real tolerance, fmi2Real start, fmi2Boolean stop_defined,
      fmi2Real stop),
     ((void)tolerance_defined, (void)tolerance, set_times(instance, call, start, stop_defined, stop)))
FMI2(EnterInitializationMode, (fmi2Component c), enter_initialization(instance, call))
FMI2(ExitInitializationMode, (fmi2Component c), exit_initialization(instance, call))
FMI2(DoStep, (fmi2Component c, fmi2Real t, fmi2Real h, fmi2Boolean keep), ((void)keep, step(instance, call, t, h)))
FMI2(Terminate, (fmi2Component c), end(instance, call))
FMI2(Reset, (fmi2Component c), (begin(instance), OK))

FMI2(GetReal, (fmi2Component c, const fmi2ValueReference r[], size_t n, fmi2Real values[]),
     VALUES(get_reals(instance, "Real", r, n, values)))
FMI2(SetReal, (fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2Real values[]),
     VALUES(set_reals(instance, "Real", r, n, values)))
FMI2(GetInteger, (fmi2Component c, const fmi2ValueReference r[], size_t n, fmi2Integer values[]),
     VALUES(get_others(instance, INTEGERS | ENUMERATIONS, "Integer", r, n, values)))
FMI2(SetInteger, (fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2Integer values[]),
     VALUES(set_others(instance, INTEGERS | ENUMERATIONS, "Integer", r, n, values)))
FMI2(GetBoolean, (fmi2Component c, const fmi2ValueReference r[], size_t n, fmi2Boolean values[]),
     VALUES(get_others(instance, BOOLEANS, "Boolean", r, n, values)))

FMI2(SetBoolean, (fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2Boolean values[]),
     VALUES(set_others(instance, BOOLEANS, "Boolean", r, n, values)))

/* There are no variables of type String. */
EXPORTED fmi2Status fmi2GetString(fmi2Component c, const fmi2ValueReference r[], size_t n, fmi2String values[])
{
    Instance *instance = c;
    const char *const call = "fmi2GetString";
    Status status = instance == NULL ? ERROR : VALUES(OK);
    for (size_t i = 0; i < n && status == OK; i++) {
        values[i] = "";
    }
    return (fmi2Status)(n == 0 || status != OK
                            ? status
                            : fail_of(instance, "reading", "String", r, n, r[0], "TypeError", " is not of type ", "String"));
}

FMI2(SetString, (fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2String values[]),
     VALUES(set_others(instance, TEXTS, "String", r, n, NULL)))

FMI2(GetFMUstate, (fmi2Component c, fmi2FMUstate *state), save(instance, call, state))
FMI2(SetFMUstate, (fmi2Component c, fmi2FMUstate state), restore(instance, call, state))
FMI2(FreeFMUstate, (fmi2Component c, fmi2FMUstate *state), free_state(state))
FMI2(SerializedFMUstateSize, (fmi2Component c, fmi2FMUstate state, size_t *size),
     size_of_state(instance, call, state, size))
FMI2(SerializeFMUstate, (fmi2Component c, fmi2FMUstate state, fmi2Byte bytes[], size_t size),
     serialize(instance, call, state, bytes, size))
FMI2(DeSerializeFMUstate, (fmi2Component c, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state),
     deserialize(instance, call, bytes, size, state))

/* Only errors are logged, and always. */
FMI2(SetDebugLogging, (fmi2Component c, fmi2Boolean on, size_t n, const fmi2String names[]),
     ((void)on, n == 0 || names != NULL ? OK : complain_of(instance, call, "no categories given")))
FMI2(GetRealStatus, (fmi2Component c, const fmi2StatusKind kind, fmi2Real *value),
     value == NULL                    ? complain_of(instance, call, "no place for the value")
     : kind != fmi2LastSuccessfulTime ? complain(instance, "fmi2GetRealStatus knows of fmi2LastSuccessfulTime alone")
                                      : (*value = instance->now.content.at.time, OK))

#define UNSUPPORTED(name, parameters, ...)                                                                  \
    FMI2(name, parameters, (__VA_ARGS__, complain(instance, "fmi2" #name " is not supported")))
FMI2_UNSUPPORTED_FUNCTIONS(UNSUPPORTED)
#undef UNSUPPORTED
#undef VALUES
