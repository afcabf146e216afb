/// @file tick_server.c
/// One request in, one reply out, until the host closes its end.
#include "semihost.h"
#include "serve.h"

static serve_core_t cores[IVL_PORT_SLOTS];

// a pipe may give less than asked for
static bool read_request(int handle, ivl_port_request_t *request)
{
    size_t n = 0;
    while (n < sizeof *request)
    {
        const size_t more = semihost_read(handle, (char *)request + n, sizeof *request - n);
        if (more == 0u)
        {
            if (n != 0u)
            {
                semihost_print("the input ends within a request\n");
                semihost_exit(EXIT_TRANSPORT);
            }
            return false;
        }
        n += more;
    }
    return true;
}

int main(void)
{
    static ivl_port_request_t request;
    static ivl_port_reply_t   reply;
    const int                 in = semihost_open_stdin();
    const int                 out = semihost_open_stdout();
    const ivl_port_hello_t    hello = ivl_port_hello();
    semihost_write(out, &hello, sizeof hello);
    while (read_request(in, &request))
    {
        serve_request(cores, ivl_step, &request, &reply);
        semihost_write(out, &reply, sizeof reply);
    }
    return 0;
}
