#include "tileflight/experiments/experiment/link_files.h"

#include <system_error>

#include "tileflight/core/base/input_error.h"

namespace tileflight::experiment {
namespace fs = std::filesystem;

void link_files(const fs::path& from, const fs::path& to) {
  for (const fs::directory_entry& entry : fs::directory_iterator(from)) {
    const fs::path target = to / entry.path().filename();
    std::error_code fault;
    if (entry.is_symlink()) {
      fs::copy_symlink(entry.path(), target, fault);
    } else if (entry.is_directory()) {
      fs::create_directory(target, fault);
      if (!fault) link_files(entry.path(), target);
    } else {
      fs::create_hard_link(entry.path(), target, fault);
      if (fault) fs::copy_file(entry.path(), target, fault);
    }
    if (fault) throw InputError(target.string(), "cannot be written: " + fault.message());
  }
}

}  // namespace tileflight::experiment
