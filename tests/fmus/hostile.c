/* A co-simulation FMU that does harm: what, and in which call, stands in the variable HOSTILE, "step:abort".
 *
 * Only the instance called "bad" does; any other computes what shows whether its surroundings are sound.
 * Inputs x (1); outputs y = 2 x + 1 / 3 (2), spare (3), text (4), count (5).
 */
#define _GNU_SOURCE
#include <fenv.h>
#include <fcntl.h>
#include <limits.h>
#include <math.h>
#include <pthread.h>
#include <setjmp.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <unistd.h>
#if defined(__x86_64__)
#include <xmmintrin.h>
#endif

#include "fmi2.h"

#define EXPORT __attribute__((visibility("default")))
#define ACT_AT 0.1 /* s, in the calls of a step */

typedef struct {
    fmi2CallbackFunctions host;
    char name[64];
    double x, t;
} Instance;

static fmi2CallbackFunctions last_host; /* also after its instance is gone */
static volatile int spinning = 1;
static volatile double zero = 0.0;

static void say(fmi2Status status, const char *text)
{
    if (last_host.logger != NULL) {
        last_host.logger(last_host.componentEnvironment, "bad", status, "hostile", "%s", text);
    }
}

static void *talk(void *nothing)
{
    for (int i = 0; i < 20000; i++) {
        say(fmi2Warning, "from a thread");
    }
    return nothing;
}

static void *spin(void *nothing)
{
    while (spinning) {
        usleep(100);
    }
    return nothing;
}

static void start(void *(*function)(void *))
{
    pthread_t thread;
    pthread_create(&thread, NULL, function, NULL);
}

static void start_child(void)
{
    if (fork() == 0) {
        for (;;) {
            pause();
        }
    }
}

static int overflow(int n)
{
    volatile char room[4096];
    room[0] = (char)n;
    return overflow(n + 1) + room[0];
}

static void quit(int number)
{
    (void)number;
    exit(0);
}

static void write_everywhere(const char *bytes, size_t size)
{
    for (int descriptor = 0; descriptor < 256; descriptor++) {
        int flags = fcntl(descriptor, F_GETFL);
        if (flags >= 0 && (flags & O_ACCMODE) != O_RDONLY) {
            fcntl(descriptor, F_SETFL, flags | O_NONBLOCK);
            if (write(descriptor, bytes, size) < 0) {
                continue;
            }
        }
    }
}

/* Do what HOSTILE says if it is meant for this call; return the status to answer with. */
static int act(const char *call, const char *name, double t)
{
    const char *wanted = getenv("HOSTILE");
    size_t length = strlen(call);
    if (wanted == NULL || strncmp(wanted, call, length) != 0 || wanted[length] != ':' ||
        (name != NULL && strcmp(name, "bad") != 0) || t < ACT_AT - 1e-9) {
        return fmi2OK;
    }
    const char *what = wanted + length + 1;
#define IS(text) (strcmp(what, text) == 0)
    if (IS("exit")) exit(0);
    if (IS("_exit")) _exit(0);
    if (IS("quick_exit")) quick_exit(0);
    if (IS("abort")) abort();
    if (IS("segfault")) raise(SIGSEGV);
    if (IS("kill")) kill(getpid(), SIGKILL);
    if (IS("kill_group")) kill(0, SIGKILL);
    if (IS("alarm")) { alarm(1); for (;;) pause(); }
    if (IS("stop")) raise(SIGSTOP);
    if (IS("overflow")) overflow(0);
    if (IS("execute")) execl("/bin/true", "true", (char *)NULL);
    if (IS("leave_thread")) pthread_exit(NULL);
    if (IS("divide")) { volatile int one = 1; one /= (int)zero; }
    if (IS("hang")) for (;;) {}
    if (IS("sleep")) for (;;) pause();
    if (IS("deaf")) { /* takes the signals away, then hangs */
        signal(SIGINT, SIG_IGN), signal(SIGTERM, SIG_IGN);
        for (;;) pause();
    }
    if (IS("blocked")) {
        sigset_t all;
        sigfillset(&all), sigprocmask(SIG_SETMASK, &all, NULL);
        for (;;) pause();
    }
    if (IS("child")) { start_child(); for (;;) pause(); }
    if (IS("child_crash")) { start_child(); raise(SIGSEGV); }
    if (IS("garbage")) { for (int i = 0; i < 9; i++) write_everywhere("garbage that is no answer\n", 26); }
    if (IS("zeros")) write_everywhere("\0\0\0\0\0\0\0\0\0", 9);
    if (IS("length")) write_everywhere("\x81\xff\xff\xff\x03{\"", 7);
    if (IS("endless")) write_everywhere("\x82\xff\xff\x00\x00{\"", 7);
    if (IS("close")) { for (int descriptor = 0; descriptor < 256; descriptor++) close(descriptor); }
    if (IS("close_output")) { close(1), close(2); }
    if (IS("print")) { for (int i = 0; i < 1000; i++) puts("\033[31mhostile\033[0m %s %n"); fflush(stdout); }
    if (IS("files")) { struct rlimit none = {3, 3}; setrlimit(RLIMIT_NOFILE, &none); }
    if (IS("size")) { struct rlimit none = {0, 0}; setrlimit(RLIMIT_FSIZE, &none); }
    if (IS("rounding")) fesetround(FE_UPWARD);
#if defined(__x86_64__)
    if (IS("flush")) _mm_setcsr(_mm_getcsr() | 0x8040);
#endif
    if (IS("trap")) feenableexcept(FE_DIVBYZERO | FE_INVALID | FE_OVERFLOW);
    if (IS("signals")) {
        for (int number = 1; number < 32; number++) signal(number, quit);
        signal(SIGPIPE, SIG_DFL);
    }
    if (IS("environment")) clearenv();
    if (IS("flood")) { for (int i = 0; i < 200000; i++) say(fmi2Warning, "again and again and again"); }
    if (IS("long")) {
        char *text = malloc(1 << 20);
        memset(text, 'x', (1 << 20) - 1), text[(1 << 20) - 1] = 0;
        for (int i = 0; i < 2000; i++) say(fmi2Warning, text);
        free(text);
    }
    if (IS("escape")) say(fmi2Warning, "\033]0;owned\007 \xff\xfe %s%n");
    if (IS("no_text") && last_host.logger != NULL)
        last_host.logger(last_host.componentEnvironment, NULL, fmi2Warning, NULL, NULL);
    if (IS("thread_log")) start(talk);
    if (IS("thread")) start(spin);
    if (IS("status_7")) return 7;
    if (IS("status_minus")) return -1;
    if (IS("status_huge")) return INT_MAX;
    if (IS("pending")) return fmi2Pending;
    if (IS("fatal")) return fmi2Fatal;
    if (IS("error")) return fmi2Error;
    if (IS("discard")) return fmi2Discard;
    return fmi2OK;
}

static int wants(const char *wanted, double t)
{
    return getenv("HOSTILE") != NULL && strcmp(getenv("HOSTILE"), wanted) == 0 && t >= ACT_AT - 1e-9;
}

__attribute__((constructor)) static void loaded(void) { act("load", NULL, 1.0); }
__attribute__((destructor)) static void unloaded(void) { act("unload", NULL, 1.0); }

EXPORT fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                                     const fmi2CallbackFunctions *host, fmi2Boolean visible, fmi2Boolean logging)
{
    (void)type, (void)guid, (void)resources, (void)visible, (void)logging;
    Instance *in = calloc(1, sizeof *in);
    in->host = *host;
    if (strcmp(name, "bad") == 0) {
        last_host = *host;
    }
    snprintf(in->name, sizeof in->name, "%s", name);
    return act("instantiate", name, 1.0) < fmi2Error ? in : NULL;
}

EXPORT void fmi2FreeInstance(fmi2Component c)
{
    Instance *in = c;
    act("free", in->name, 1.0);
    if (wants("free:log_after", 1.0)) { /* as an FMU does whose thread comes too late */
        start(talk);
    }
    free(in);
}

#define PHASE(Name, call, parameters)                                                                       \
    EXPORT fmi2Status fmi2##Name parameters { return act(call, ((Instance *)c)->name, 1.0); }

PHASE(Terminate, "terminate", (fmi2Component c))
PHASE(SetupExperiment, "setup", (fmi2Component c, fmi2Boolean a, fmi2Real b, fmi2Real d, fmi2Boolean e, fmi2Real f))
PHASE(EnterInitializationMode, "enter", (fmi2Component c))
PHASE(ExitInitializationMode, "leave", (fmi2Component c))

EXPORT fmi2Status fmi2DoStep(fmi2Component c, fmi2Real t, fmi2Real h, fmi2Boolean keep)
{
    (void)keep;
    Instance *in = c;
    in->t = t + h;
    return act("step", in->name, t);
}

EXPORT fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2Real v[])
{
    Instance *in = c;
    for (size_t i = 0; i < n; i++) {
        if (r[i] == 1) in->x = v[i];
    }
    return act("set", in->name, in->t);
}

EXPORT fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference r[], size_t n, fmi2Real v[])
{
    Instance *in = c;
    volatile double third = 1.0, tiny = 1e-308;
    third /= 3.0; /* shows the rounding mode */
    tiny *= 1e-3; /* shows whether small numbers are flushed to zero */
    for (size_t i = 0; i < n; i++) {
        v[i] = r[i] == 1 ? in->x : r[i] == 2 ? 2.0 * in->x + third : tiny * 1e308 + 0.5;
        if (r[i] == 3 && strcmp(in->name, "bad") == 0 && wants("value:nan", in->t)) v[i] = zero / zero;
        if (r[i] == 3 && strcmp(in->name, "bad") == 0 && wants("value:inf", in->t)) v[i] = 1.0 / zero;
        if (r[i] == 2 && strcmp(in->name, "bad") == 0 && wants("value:wired_nan", in->t)) v[i] = zero / zero;
    }
    return act("get", in->name, in->t);
}

EXPORT fmi2Status fmi2GetString(fmi2Component c, const fmi2ValueReference r[], size_t n, fmi2String v[])
{
    Instance *in = c;
    static char *huge;
    size_t size = wants("value:huge_text", in->t) && strcmp(in->name, "bad") == 0 ? (size_t)80 << 20 : 0;
    for (size_t i = 0; i < n; i++) {
        v[i] = "text";
        if (size > 0) {
            huge = realloc(huge, size);
            memset(huge, 'x', size - 1), huge[size - 1] = 0;
            v[i] = huge;
        } else if (wants("value:no_text", in->t)) {
            v[i] = NULL;
        } else if (wants("value:not_utf8", in->t)) {
            v[i] = "\xff\xfe\x1b[31m";
        }
    }
    return fmi2OK;
}

EXPORT fmi2Status fmi2GetInteger(fmi2Component c, const fmi2ValueReference r[], size_t n, fmi2Integer v[])
{
    for (size_t i = 0; i < n; i++) v[i] = wants("value:count", ((Instance *)c)->t) ? INT_MIN : 7;
    return fmi2OK;
}

#include "idle.h"

ALWAYS_OK(SetInteger, (fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2Integer v[]))
ALWAYS_OK(SetBoolean, (fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2Boolean v[]))
ALWAYS_OK(GetBoolean, (fmi2Component c, const fmi2ValueReference r[], size_t n, fmi2Boolean v[]))
ALWAYS_OK(SetString, (fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2String v[]))
ALWAYS_OK(GetRealStatus, (fmi2Component c, fmi2StatusKind k, fmi2Real *v))
ALWAYS_OK(GetBooleanStatus, (fmi2Component c, fmi2StatusKind k, fmi2Boolean *v))
