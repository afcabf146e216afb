#define _GNU_SOURCE
#include "crtp_udp.h"

#include <arpa/inet.h>
#include <errno.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <poll.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>
#ifdef __linux__
#include <linux/errqueue.h>
#endif

enum
{
    BUFFER_BYTES = 1 << 20
};

static uint64_t number_of(const struct sockaddr_in *address)
{
    return ((uint64_t)ntohl(address->sin_addr.s_addr) << 16) | ntohs(address->sin_port);
}

static struct sockaddr_in address_of(uint64_t peer)
{
    struct sockaddr_in address = {.sin_family = AF_INET, .sin_port = htons((uint16_t)(peer & 0xffffu))};
    address.sin_addr.s_addr = htonl((uint32_t)(peer >> 16));
    return address;
}

static bool bind_to(int fd, const char *text, uint16_t *port, char *error, size_t error_size)
{
    struct sockaddr_in address = address_of(*port);
    socklen_t          length = sizeof address;
    if (inet_pton(AF_INET, text, &address.sin_addr) != 1)
    {
        snprintf(error, error_size, "%s: is no IPv4 address (for example 127.0.0.1, or 0.0.0.0 for all)", text);
        return false;
    }
    if (bind(fd, (const struct sockaddr *)&address, sizeof address) != 0)
    {
        const char *hint = (errno == EADDRINUSE) ? "; another vehicle may be running there: choose another port" : "";
        snprintf(error, error_size, "%s:%u: %s%s", text, *port, strerror(errno), hint);
        return false;
    }
    if (getsockname(fd, (struct sockaddr *)&address, &length) != 0)
    {
        snprintf(error, error_size, "%s: getsockname: %s", text, strerror(errno));
        return false;
    }
    *port = ntohs(address.sin_port);
    return true;
}

int ivl_crtp_udp_open(const char *address, uint16_t *port, char *error, size_t error_size)
{
    const int fd = socket(AF_INET, SOCK_DGRAM, 0);
    if ((fd < 0) || (fcntl(fd, F_SETFL, O_NONBLOCK) != 0))
    {
        snprintf(error, error_size, "socket: %s", strerror(errno));
        ivl_crtp_udp_close(fd);
        return -1;
    }
    // a burst of requests waits here while the vehicle steps; the system may grant less
    const int wished = BUFFER_BYTES;
    (void)setsockopt(fd, SOL_SOCKET, SO_RCVBUF, &wished, sizeof wished);
    (void)setsockopt(fd, SOL_SOCKET, SO_SNDBUF, &wished, sizeof wished);
#ifdef IP_RECVERR
    // the system then tells which address a refused packet had been sent to
    const int on = 1;
    (void)setsockopt(fd, IPPROTO_IP, IP_RECVERR, &on, sizeof on);
#endif
    if (!bind_to(fd, address, port, error, error_size))
    {
        ivl_crtp_udp_close(fd);
        return -1;
    }
    return fd;
}

void ivl_crtp_udp_close(int fd)
{
    if (fd >= 0)
    {
        close(fd);
    }
}

static bool take_error(int fd, uint64_t *peer)
{
#ifdef IP_RECVERR
    struct sockaddr_in address = {0};
    uint8_t            payload[64];
    union
    {
        struct cmsghdr align;
        uint8_t        bytes[512];
    } control;
    struct iovec  iov = {.iov_base = payload, .iov_len = sizeof payload};
    struct msghdr message = {.msg_name = &address,
                             .msg_namelen = sizeof address,
                             .msg_iov = &iov,
                             .msg_iovlen = 1,
                             .msg_control = control.bytes,
                             .msg_controllen = sizeof control.bytes};
    if (recvmsg(fd, &message, MSG_ERRQUEUE | MSG_DONTWAIT) < 0)
    {
        return false;
    }
    *peer = number_of(&address);
    return true;
#else
    (void)fd;
    (void)peer;
    return false;
#endif
}

ivl_crtp_udp_event_t ivl_crtp_udp_take(int fd, uint8_t *bytes, size_t capacity, size_t *size, uint64_t *peer)
{
    struct sockaddr_in address;
    socklen_t          length = sizeof address;
    // a pending error makes one call fail, the packets behind it are still there
    for (int attempt = 0; attempt < 2; attempt++)
    {
        const ssize_t n = recvfrom(fd, bytes, capacity, MSG_DONTWAIT | MSG_TRUNC, (struct sockaddr *)&address, &length);
        if (n >= 0)
        {
            *size = (size_t)n;
            *peer = number_of(&address);
            return IVL_CRTP_UDP_PACKET;
        }
    }
    // looked at even if no call has failed: a failing sendto takes the error away and leaves its entry here
    return take_error(fd, peer) ? IVL_CRTP_UDP_GONE : IVL_CRTP_UDP_NOTHING;
}

void ivl_crtp_udp_send(int fd, uint64_t peer, const void *bytes, size_t size)
{
    const struct sockaddr_in address = address_of(peer);
    // the first call may only report that an earlier packet was refused
    for (int attempt = 0; attempt < 2; attempt++)
    {
        if ((sendto(fd, bytes, size, MSG_DONTWAIT, (const struct sockaddr *)&address, sizeof address) >= 0) || (errno != ECONNREFUSED))
        {
            return;
        }
    }
}

bool ivl_crtp_udp_tells(uint64_t peer)
{
#ifdef IP_RECVERR
    return (peer >> 40) == 127u;  // the machine itself; the packet of another one may be lost, or may never come
#else
    (void)peer;
    return false;
#endif
}

void ivl_crtp_udp_wait(int fd_1, int fd_2, uint64_t wait_us)
{
    struct pollfd         fds[2] = {{.fd = fd_1, .events = POLLIN}, {.fd = fd_2, .events = POLLIN}};
    const struct timespec time = {.tv_sec = (time_t)(wait_us / 1000000u), .tv_nsec = (long)(wait_us % 1000000u) * 1000};
    (void)ppoll(fds, 2, &time, NULL);
}

void ivl_crtp_udp_text(uint64_t peer, char *text, size_t size)
{
    const unsigned ip = (unsigned)(peer >> 16);
    snprintf(text, size, "%u.%u.%u.%u:%u", ip >> 24, (ip >> 16) & 0xffu, (ip >> 8) & 0xffu, ip & 0xffu, (unsigned)(peer & 0xffffu));
}
