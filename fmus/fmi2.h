/* The types and functions of FMI 2.0 for co-simulation, as the standard (2.0.4) names them. */
#ifndef YAWBENCH_FMI2_H
#define YAWBENCH_FMI2_H

#include <stddef.h>

typedef void *fmi2Component;
typedef void *fmi2ComponentEnvironment;
typedef void *fmi2FMUstate;
typedef unsigned int fmi2ValueReference;
typedef double fmi2Real;
typedef int fmi2Integer;
typedef int fmi2Boolean;
typedef char fmi2Char;
typedef const fmi2Char *fmi2String;
typedef char fmi2Byte;

enum { fmi2False = 0, fmi2True = 1 };

typedef enum { fmi2OK, fmi2Warning, fmi2Discard, fmi2Error, fmi2Fatal, fmi2Pending } fmi2Status;
typedef enum { fmi2ModelExchange, fmi2CoSimulation } fmi2Type;
typedef enum { fmi2DoStepStatus, fmi2PendingStatus, fmi2LastSuccessfulTime, fmi2Terminated } fmi2StatusKind;

typedef void fmi2Logger(fmi2ComponentEnvironment, fmi2String instance, fmi2Status, fmi2String category,
                        fmi2String message, ...);

typedef struct {
    fmi2Logger *logger;
    void *(*allocateMemory)(size_t, size_t);
    void (*freeMemory)(void *);
    void (*stepFinished)(fmi2ComponentEnvironment, fmi2Status);
    fmi2ComponentEnvironment componentEnvironment;
} fmi2CallbackFunctions;

/* Functions that answer with a status, and that a library has to provide: X(name, parameters). */
#define FMI2_STATUS_FUNCTIONS(X)                                                                            \
    X(SetDebugLogging, (fmi2Component, fmi2Boolean, size_t, const fmi2String[]))                            \
    X(SetupExperiment, (fmi2Component, fmi2Boolean, fmi2Real, fmi2Real, fmi2Boolean, fmi2Real))             \
    X(EnterInitializationMode, (fmi2Component))                                                             \
    X(ExitInitializationMode, (fmi2Component))                                                              \
    X(Terminate, (fmi2Component))                                                                           \
    X(Reset, (fmi2Component))                                                                               \
    X(GetReal, (fmi2Component, const fmi2ValueReference[], size_t, fmi2Real[]))                             \
    X(GetInteger, (fmi2Component, const fmi2ValueReference[], size_t, fmi2Integer[]))                       \
    X(GetBoolean, (fmi2Component, const fmi2ValueReference[], size_t, fmi2Boolean[]))                       \
    X(GetString, (fmi2Component, const fmi2ValueReference[], size_t, fmi2String[]))                         \
    X(SetReal, (fmi2Component, const fmi2ValueReference[], size_t, const fmi2Real[]))                       \
    X(SetInteger, (fmi2Component, const fmi2ValueReference[], size_t, const fmi2Integer[]))                 \
    X(SetBoolean, (fmi2Component, const fmi2ValueReference[], size_t, const fmi2Boolean[]))                 \
    X(SetString, (fmi2Component, const fmi2ValueReference[], size_t, const fmi2String[]))                   \
    X(GetFMUstate, (fmi2Component, fmi2FMUstate *))                                                         \
    X(SetFMUstate, (fmi2Component, fmi2FMUstate))                                                           \
    X(FreeFMUstate, (fmi2Component, fmi2FMUstate *))                                                        \
    X(SerializedFMUstateSize, (fmi2Component, fmi2FMUstate, size_t *))                                      \
    X(SerializeFMUstate, (fmi2Component, fmi2FMUstate, fmi2Byte[], size_t))                                 \
    X(DeSerializeFMUstate, (fmi2Component, const fmi2Byte[], size_t, fmi2FMUstate *))                       \
    X(DoStep, (fmi2Component, fmi2Real, fmi2Real, fmi2Boolean))

/* Those that FMUs of this project do not support: X(name, parameters, how the parameters are left unused). */
#define FMI2_UNSUPPORTED_FUNCTIONS(X)                                                                       \
    X(GetDirectionalDerivative,                                                                             \
      (fmi2Component c, const fmi2ValueReference unknown[], size_t n_unknown,                               \
       const fmi2ValueReference known[], size_t n_known, const fmi2Real d_known[], fmi2Real d_unknown[]),   \
      (void)unknown, (void)n_unknown, (void)known, (void)n_known, (void)d_known, (void)d_unknown)           \
    X(SetRealInputDerivatives,                                                                              \
      (fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2Integer order[],                  \
       const fmi2Real values[]),                                                                            \
      (void)r, (void)n, (void)order, (void)values)                                                          \
    X(GetRealOutputDerivatives,                                                                             \
      (fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2Integer order[],                  \
       fmi2Real values[]),                                                                                  \
      (void)r, (void)n, (void)order, (void)values)                                                          \
    X(CancelStep, (fmi2Component c), (void)c)                                                               \
    X(GetStatus, (fmi2Component c, const fmi2StatusKind kind, fmi2Status *value), (void)kind, (void)value)  \
    X(GetIntegerStatus, (fmi2Component c, const fmi2StatusKind kind, fmi2Integer *value),                   \
      (void)kind, (void)value)                                                                              \
    X(GetBooleanStatus, (fmi2Component c, const fmi2StatusKind kind, fmi2Boolean *value),                   \
      (void)kind, (void)value)                                                                              \
    X(GetStringStatus, (fmi2Component c, const fmi2StatusKind kind, fmi2String *value), (void)kind, (void)value)

/* fmi2<name>Fn is a pointer to the function fmi2<name>. */
#define FMI2_POINTER_TYPE(name, parameters) typedef fmi2Status(*fmi2##name##Fn) parameters;
FMI2_STATUS_FUNCTIONS(FMI2_POINTER_TYPE)
#undef FMI2_POINTER_TYPE

typedef fmi2String (*fmi2GetVersionFn)(void);
typedef fmi2Component (*fmi2InstantiateFn)(fmi2String name, fmi2Type, fmi2String guid, fmi2String resources,
                                           const fmi2CallbackFunctions *, fmi2Boolean visible,
                                           fmi2Boolean logging_on);
typedef void (*fmi2FreeInstanceFn)(fmi2Component);

#endif
