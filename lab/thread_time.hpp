// How long one thread has computed: what others do at the same time doesn't count.
#pragma once

#include <ctime>

namespace harco::lab {

/// CPU time of this thread, ms.
inline double thread_ms() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return 1e3 * static_cast<double>(now.tv_sec) + 1e-6 * static_cast<double>(now.tv_nsec);
}

}  // namespace harco::lab
