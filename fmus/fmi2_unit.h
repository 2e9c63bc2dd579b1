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

#define FMI2(name, parameters, answer) ANSWER(fmi2, name, parameters, answer)
FUNCTIONS_OF_BOTH(fmi2, FMUstate, DeSerialize)

#define VALUES(answer)                                                                                      \
    (n > 0 && (r == NULL || values == NULL) ? complain_of(instance, call, "value references or values are missing") \
                                            : (answer))

FMI2(SetupExperiment,
     (fmi2Component c, fmi2Boolean tolerance_defined, fmi2Real tolerance, fmi2Real start, fmi2Boolean stop_defined,
      fmi2Real stop),
     ((void)tolerance_defined, (void)tolerance, set_times(instance, call, start, stop_defined, stop)))
FMI2(EnterInitializationMode, (fmi2Component c), enter_initialization(instance, call))
FMI2(DoStep, (fmi2Component c, fmi2Real t, fmi2Real h, fmi2Boolean keep), ((void)keep, step(instance, call, t, h)))

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

FMI2(GetRealStatus, (fmi2Component c, const fmi2StatusKind kind, fmi2Real *value),
     value == NULL                    ? complain_of(instance, call, "no place for the value")
     : kind != fmi2LastSuccessfulTime ? complain(instance, "fmi2GetRealStatus knows of fmi2LastSuccessfulTime alone")
                                      : (*value = instance->now.content.at.time, OK))

#define UNSUPPORTED(name, parameters, ...)                                                                  \
    FMI2(name, parameters, (__VA_ARGS__, complain(instance, "fmi2" #name " is not supported")))
FMI2_UNSUPPORTED_FUNCTIONS(UNSUPPORTED)
#undef UNSUPPORTED
#undef VALUES
