/* The types of FMI 3.0, as the standard (3.0.2) names them, and the functions that FMUs of this project do not support. */
#ifndef YAWBENCH_FMI3_H
#define YAWBENCH_FMI3_H

#include <stddef.h>
#include <stdint.h>

typedef void *fmi3Instance;
typedef void *fmi3InstanceEnvironment;
typedef void *fmi3FMUState;
typedef uint32_t fmi3ValueReference;
typedef float fmi3Float32;
typedef double fmi3Float64;
typedef int8_t fmi3Int8;
typedef uint8_t fmi3UInt8;
typedef int16_t fmi3Int16;
typedef uint16_t fmi3UInt16;
typedef int32_t fmi3Int32;
typedef uint32_t fmi3UInt32;
typedef int64_t fmi3Int64;
typedef uint64_t fmi3UInt64;
typedef _Bool fmi3Boolean;
typedef char fmi3Char;
typedef const fmi3Char *fmi3String;
typedef uint8_t fmi3Byte;
typedef const fmi3Byte *fmi3Binary;
typedef _Bool fmi3Clock;

typedef enum { fmi3OK, fmi3Warning, fmi3Discard, fmi3Error, fmi3Fatal } fmi3Status;
typedef enum { fmi3Independent, fmi3Constant, fmi3Fixed, fmi3Tunable, fmi3Discrete, fmi3Dependent } fmi3DependencyKind;
typedef enum { fmi3IntervalNotYetKnown, fmi3IntervalUnchanged, fmi3IntervalChanged } fmi3IntervalQualifier;

typedef void (*fmi3LogMessageCallback)(fmi3InstanceEnvironment, fmi3Status, fmi3String category, fmi3String message);
typedef void (*fmi3ClockUpdateCallback)(fmi3InstanceEnvironment);
typedef void (*fmi3LockPreemptionCallback)(void);
typedef void (*fmi3UnlockPreemptionCallback)(void);
typedef void (*fmi3IntermediateUpdateCallback)(fmi3InstanceEnvironment, fmi3Float64 time, fmi3Boolean requested,
                                               fmi3Boolean set, fmi3Boolean get, fmi3Boolean finished,
                                               fmi3Boolean may_return, fmi3Boolean *returns, fmi3Float64 *return_time);

/* Types of variables that these FMUs do not have: X(type). */
#define FMI3_OTHER_TYPES(X) X(Float32) X(Int8) X(UInt8) X(Int16) X(UInt16) X(UInt32) X(UInt64)

/* X(name, parameters) */
#define FMI3_UNSUPPORTED_FUNCTIONS(X)                                                                       \
    X(GetBinary, (fmi3Instance c, const fmi3ValueReference r[], size_t n, size_t sizes[], fmi3Binary values[], size_t m)) \
    X(SetBinary, (fmi3Instance c, const fmi3ValueReference r[], size_t n, const size_t sizes[], const fmi3Binary values[], size_t m)) \
    X(GetClock, (fmi3Instance c, const fmi3ValueReference r[], size_t n, fmi3Clock values[]))               \
    X(SetClock, (fmi3Instance c, const fmi3ValueReference r[], size_t n, const fmi3Clock values[]))         \
    X(GetNumberOfVariableDependencies, (fmi3Instance c, fmi3ValueReference r, size_t *n))                   \
    X(GetVariableDependencies, (fmi3Instance c, fmi3ValueReference r, size_t elements[], fmi3ValueReference on[], size_t of[], fmi3DependencyKind kinds[], size_t n)) \
    X(GetDirectionalDerivative, (fmi3Instance c, const fmi3ValueReference unknowns[], size_t n_unknowns, const fmi3ValueReference knowns[], size_t n_knowns, const fmi3Float64 seed[], size_t n_seed, fmi3Float64 sensitivity[], size_t n_sensitivity)) \
    X(GetAdjointDerivative, (fmi3Instance c, const fmi3ValueReference unknowns[], size_t n_unknowns, const fmi3ValueReference knowns[], size_t n_knowns, const fmi3Float64 seed[], size_t n_seed, fmi3Float64 sensitivity[], size_t n_sensitivity)) \
    X(GetOutputDerivatives, (fmi3Instance c, const fmi3ValueReference r[], size_t n, const fmi3Int32 orders[], fmi3Float64 values[], size_t m)) \
    X(GetIntervalDecimal, (fmi3Instance c, const fmi3ValueReference r[], size_t n, fmi3Float64 intervals[], fmi3IntervalQualifier qualifiers[])) \
    X(GetIntervalFraction, (fmi3Instance c, const fmi3ValueReference r[], size_t n, fmi3UInt64 counters[], fmi3UInt64 resolutions[], fmi3IntervalQualifier qualifiers[])) \
    X(GetShiftDecimal, (fmi3Instance c, const fmi3ValueReference r[], size_t n, fmi3Float64 shifts[]))      \
    X(GetShiftFraction, (fmi3Instance c, const fmi3ValueReference r[], size_t n, fmi3UInt64 counters[], fmi3UInt64 resolutions[])) \
    X(SetIntervalDecimal, (fmi3Instance c, const fmi3ValueReference r[], size_t n, const fmi3Float64 intervals[])) \
    X(SetIntervalFraction, (fmi3Instance c, const fmi3ValueReference r[], size_t n, const fmi3UInt64 counters[], const fmi3UInt64 resolutions[])) \
    X(SetShiftDecimal, (fmi3Instance c, const fmi3ValueReference r[], size_t n, const fmi3Float64 shifts[])) \
    X(SetShiftFraction, (fmi3Instance c, const fmi3ValueReference r[], size_t n, const fmi3UInt64 counters[], const fmi3UInt64 resolutions[])) \
    X(EnterEventMode, (fmi3Instance c)) X(EnterStepMode, (fmi3Instance c)) X(EvaluateDiscreteStates, (fmi3Instance c)) \
    X(EnterConfigurationMode, (fmi3Instance c)) X(ExitConfigurationMode, (fmi3Instance c))                  \
    X(UpdateDiscreteStates, (fmi3Instance c, fmi3Boolean *needed, fmi3Boolean *terminate, fmi3Boolean *nominals, fmi3Boolean *values, fmi3Boolean *defined, fmi3Float64 *time)) \
    X(EnterContinuousTimeMode, (fmi3Instance c))                                                            \
    X(CompletedIntegratorStep, (fmi3Instance c, fmi3Boolean no_set_state, fmi3Boolean *event, fmi3Boolean *terminate)) \
    X(SetTime, (fmi3Instance c, fmi3Float64 time)) X(SetContinuousStates, (fmi3Instance c, const fmi3Float64 x[], size_t n)) \
    X(GetContinuousStateDerivatives, (fmi3Instance c, fmi3Float64 x[], size_t n))                           \
    X(GetEventIndicators, (fmi3Instance c, fmi3Float64 x[], size_t n))                                      \
    X(GetContinuousStates, (fmi3Instance c, fmi3Float64 x[], size_t n))                                     \
    X(GetNominalsOfContinuousStates, (fmi3Instance c, fmi3Float64 x[], size_t n))                           \
    X(GetNumberOfEventIndicators, (fmi3Instance c, size_t *n)) X(GetNumberOfContinuousStates, (fmi3Instance c, size_t *n)) \
    X(ActivateModelPartition, (fmi3Instance c, fmi3ValueReference clock, fmi3Float64 time))

#endif
