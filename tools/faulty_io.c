/* A disk that fails, for tools/borders.py: loaded before libc, it lets one operation on a folder fail, or ends the
 * process there.  Operations are counted from ivl_fault_arm on: opening for writing, writing, flushing, truncating,
 * renaming, removing, locking.  A full disk stays full. */

#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include <sys/types.h>
#include <unistd.h>

static char folder[4096];
static long strike_at = -1, count;
static int  error_number; /* 0: SIGKILL */

void ivl_fault_arm(const char *path, long at, int error)
{
    snprintf(folder, sizeof folder, "%s", path);
    count = 0;
    error_number = error;
    strike_at = at;
}

long ivl_fault_count(void)
{
    return count;
}

static int strikes(const char *path)
{
    if (strike_at < 0 || strncmp(path, folder, strlen(folder)) != 0)
    {
        return 0;
    }
    long now = count++;
    if (now < strike_at || (now > strike_at && error_number != ENOSPC))
    {
        return 0;
    }
    if (error_number == 0)
    {
        raise(SIGKILL);
    }
    errno = error_number;
    return 1;
}

static int strikes_fd(int fd)
{
    if (strike_at < 0)
    {
        return 0;
    }
    char link[64], path[4096];
    snprintf(link, sizeof link, "/proc/self/fd/%d", fd);
    ssize_t n = readlink(link, path, sizeof path - 1);
    path[n < 0 ? 0 : n] = '\0';
    return strikes(path);
}

#define REAL(name) ((__typeof__(&name))dlsym(RTLD_NEXT, #name))

#define OPEN(name)                                                                                                                         \
    int name(const char *path, int flags, ...)                                                                                             \
    {                                                                                                                                      \
        va_list rest;                                                                                                                      \
        va_start(rest, flags);                                                                                                             \
        mode_t mode = va_arg(rest, mode_t);                                                                                                \
        va_end(rest);                                                                                                                      \
        return (flags & (O_WRONLY | O_RDWR)) && strikes(path) ? -1 : REAL(name)(path, flags, mode);                                        \
    }
OPEN(open)
OPEN(open64)

/* a write that fails has written half of it */
ssize_t write(int fd, const void *data, size_t n)
{
    if (!strikes_fd(fd))
    {
        return REAL(write)(fd, data, n);
    }
    int error = errno;
    (void)!REAL(write)(fd, data, n / 2);
    errno = error;
    return -1;
}

ssize_t pwrite64(int fd, const void *data, size_t n, off64_t offset)
{
    if (!strikes_fd(fd))
    {
        return REAL(pwrite64)(fd, data, n, offset);
    }
    int error = errno;
    (void)!REAL(pwrite64)(fd, data, n / 2, offset);
    errno = error;
    return -1;
}

int fsync(int fd)
{
    return strikes_fd(fd) ? -1 : REAL(fsync)(fd);
}
int fdatasync(int fd)
{
    return strikes_fd(fd) ? -1 : REAL(fdatasync)(fd);
}
int ftruncate64(int fd, off64_t length)
{
    return strikes_fd(fd) ? -1 : REAL(ftruncate64)(fd, length);
}
int rename(const char *from, const char *to)
{
    return strikes(to) ? -1 : REAL(rename)(from, to);
}
int unlink(const char *path)
{
    return error_number != ENOSPC && strikes(path) ? -1 : REAL(unlink)(path);
}
int flock(int fd, int how)
{
    return error_number == ENOLCK && strikes_fd(fd) ? -1 : REAL(flock)(fd, how);
}
