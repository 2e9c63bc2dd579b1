/* Functions of FMI 2.0 that answer OK and do nothing, and the version: what many FMUs leave out. For FMUs of tests;
   EXPORT is theirs. */

#define ALWAYS_OK(Name, parameters) EXPORT fmi2Status fmi2##Name parameters { return fmi2OK; }

ALWAYS_OK(SetDebugLogging, (fmi2Component c, fmi2Boolean on, size_t n, const fmi2String names[]))
ALWAYS_OK(Reset, (fmi2Component c))
ALWAYS_OK(GetFMUstate, (fmi2Component c, fmi2FMUstate *s))
ALWAYS_OK(SetFMUstate, (fmi2Component c, fmi2FMUstate s))
ALWAYS_OK(FreeFMUstate, (fmi2Component c, fmi2FMUstate *s))
ALWAYS_OK(SerializedFMUstateSize, (fmi2Component c, fmi2FMUstate s, size_t *n))
ALWAYS_OK(SerializeFMUstate, (fmi2Component c, fmi2FMUstate s, fmi2Byte b[], size_t n))
ALWAYS_OK(DeSerializeFMUstate, (fmi2Component c, const fmi2Byte b[], size_t n, fmi2FMUstate *s))
ALWAYS_OK(GetDirectionalDerivative, (fmi2Component c, const fmi2ValueReference a[], size_t n,
                                     const fmi2ValueReference b[], size_t m, const fmi2Real d[], fmi2Real e[]))
ALWAYS_OK(SetRealInputDerivatives, (fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2Integer o[],
                                    const fmi2Real v[]))
ALWAYS_OK(GetRealOutputDerivatives, (fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2Integer o[],
                                     fmi2Real v[]))
ALWAYS_OK(CancelStep, (fmi2Component c))
ALWAYS_OK(GetStatus, (fmi2Component c, fmi2StatusKind k, fmi2Status *s))
ALWAYS_OK(GetIntegerStatus, (fmi2Component c, fmi2StatusKind k, fmi2Integer *v))
ALWAYS_OK(GetStringStatus, (fmi2Component c, fmi2StatusKind k, fmi2String *v))

EXPORT const char *fmi2GetTypesPlatform(void) { return "default"; }
EXPORT const char *fmi2GetVersion(void) { return "2.0"; }
