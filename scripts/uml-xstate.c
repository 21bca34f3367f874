/* Lets Debian's user-mode kernel 6.1 run on processors with AMX.
 *
 * It keeps 2696 bytes of floating-point registers and writes them back by PTRACE_SETREGSET. Where AMX makes the set larger the host
 * refuses a part of it (EFAULT, "ptrace set fp regs failed"): here the rest is filled up with what the process has.
 * Preloaded by uml-run. Later user-mode kernels ask for the size themselves.
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <elf.h>
#include <stdarg.h>
#include <string.h>
#include <sys/ptrace.h>
#include <sys/types.h>
#include <sys/uio.h>

typedef long (*ptrace_type)(enum __ptrace_request request, ...);

static char whole[1 << 16]; /* the set is 11 kB with AMX; uml-run gives the kernel one processor, so nobody else writes here */

long ptrace(enum __ptrace_request request, ...)
{
	static ptrace_type next;
	va_list rest;

	if (!next)
		next = (ptrace_type)dlsym(RTLD_NEXT, "ptrace");
	va_start(rest, request);
	pid_t pid = va_arg(rest, pid_t);
	void *address = va_arg(rest, void *), *data = va_arg(rest, void *);
	va_end(rest);
	if (request == PTRACE_SETREGSET && address == (void *)NT_X86_XSTATE) {
		const struct iovec *part = data;
		struct iovec set = {whole, sizeof whole};

		if (next(PTRACE_GETREGSET, pid, address, &set) < 0)
			return -1;
		if (part->iov_len < set.iov_len) {
			memcpy(whole, part->iov_base, part->iov_len);
			return next(request, pid, address, &set);
		}
	}
	return next(request, pid, address, data);
}
