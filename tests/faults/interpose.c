/* Faults of disk and clock, loaded before the system's library: what the file that FEEDWAVE_FAULTS names says, at once.
   Only files of a store are affected: those with "feedwave.db" in their path. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <time.h>
#include <unistd.h>

/* As in faults/library.rs. */
struct control {
    int32_t write_errno;
    int32_t sync_errno;
    int32_t sync_hangs;
    int32_t spares_log;
    int64_t clock_offset_s;
    int32_t read_errno;
    int32_t read_hangs;
    int32_t sync_delay_ms;
};

static volatile struct control *control;

__attribute__((constructor)) static void begin(void) {
    const char *path = getenv("FEEDWAVE_FAULTS");
    int file = path ? open(path, O_RDWR | O_CLOEXEC) : -1;
    if (file >= 0) {
        void *page = mmap(NULL, 4096, PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
        if (page != MAP_FAILED)
            control = page;
        close(file);
    }
}

static int of_store(int file) {
    char link[64], path[4096];
    snprintf(link, sizeof link, "/proc/self/fd/%d", file);
    ssize_t length = readlink(link, path, sizeof path - 1);
    if (length < 0)
        return 0;
    path[length] = 0;
    if (control->spares_log && strstr(path, "-wal"))
        return 0;
    return strstr(path, "feedwave.db") != NULL;
}

static int write_fails(int file) {
    if (!control || !control->write_errno || !of_store(file))
        return 0;
    errno = control->write_errno;
    return 1;
}

static int sync_fails(int file) {
    if (!control || !(control->sync_errno || control->sync_hangs || control->sync_delay_ms) || !of_store(file))
        return 0;
    usleep(1000 * control->sync_delay_ms);
    while (control->sync_hangs)
        usleep(5000);
    if (!control->sync_errno)
        return 0;
    errno = control->sync_errno;
    return 1;
}

#define REAL(name) ((__typeof__(&name))dlsym(RTLD_NEXT, #name))

ssize_t write(int file, const void *data, size_t size) {
    static __typeof__(&write) real;
    if (!real)
        real = REAL(write);
    return write_fails(file) ? -1 : real(file, data, size);
}

ssize_t pwrite(int file, const void *data, size_t size, off_t offset) {
    static __typeof__(&pwrite) real;
    if (!real)
        real = REAL(pwrite);
    return write_fails(file) ? -1 : real(file, data, size, offset);
}

ssize_t pwrite64(int file, const void *data, size_t size, off64_t offset) {
    static __typeof__(&pwrite64) real;
    if (!real)
        real = REAL(pwrite64);
    return write_fails(file) ? -1 : real(file, data, size, offset);
}

static int read_fails(int file) {
    if (!control || !(control->read_errno || control->read_hangs) || !of_store(file))
        return 0;
    while (control->read_hangs)
        usleep(5000);
    if (!control->read_errno)
        return 0;
    errno = control->read_errno;
    return 1;
}

ssize_t pread(int file, void *data, size_t size, off_t offset) {
    static __typeof__(&pread) real;
    if (!real)
        real = REAL(pread);
    return read_fails(file) ? -1 : real(file, data, size, offset);
}

ssize_t pread64(int file, void *data, size_t size, off64_t offset) {
    static __typeof__(&pread64) real;
    if (!real)
        real = REAL(pread64);
    return read_fails(file) ? -1 : real(file, data, size, offset);
}

int fsync(int file) {
    static __typeof__(&fsync) real;
    if (!real)
        real = REAL(fsync);
    return sync_fails(file) ? -1 : real(file);
}

int fdatasync(int file) {
    static __typeof__(&fdatasync) real;
    if (!real)
        real = REAL(fdatasync);
    return sync_fails(file) ? -1 : real(file);
}

int clock_gettime(clockid_t clock, struct timespec *now) {
    static __typeof__(&clock_gettime) real;
    if (!real)
        real = REAL(clock_gettime);
    int result = real(clock, now);
    if (!result && control && clock == CLOCK_REALTIME)
        now->tv_sec += control->clock_offset_s;
    return result;
}
