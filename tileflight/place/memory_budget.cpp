#include "tileflight/place/memory_budget.h"

#include <unistd.h>

#include <limits>

namespace tileflight::place {

std::uintmax_t default_memory_bytes() {
  const long pages = sysconf(_SC_PHYS_PAGES), page_bytes = sysconf(_SC_PAGESIZE);
  if (pages <= 0 || page_bytes <= 0) return std::numeric_limits<std::uintmax_t>::max();
  return static_cast<std::uintmax_t>(pages) / 2 * static_cast<std::uintmax_t>(page_bytes);
}

}  // namespace tileflight::place
