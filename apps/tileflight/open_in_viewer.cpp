#include "open_in_viewer.h"

#include <chrono>
#include <string>
#include <thread>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/jobs/process.h"

namespace tileflight::app {

void open_in_viewer(const std::filesystem::path& file) {
  /// xdg-open reports failure within this time; on some desktops it runs as long as the viewer.
  constexpr std::chrono::milliseconds kPatience{3000}, kStep{20};
  jobs::Process viewer({.words = {"xdg-open", file.string()}});
  viewer.leave_running();
  for (auto waited = std::chrono::milliseconds(0); waited < kPatience; waited += kStep) {
    if (const std::optional<int> status = viewer.exit_status()) {
      if (*status == 0) return;
      throw InputError(file.string(), std::string("was written but could not be opened: ") +
                                          (*status == 127 ? "xdg-open is not installed (package xdg-utils)"
                                                          : "xdg-open found no browser") +
                                          "; open it in a browser by hand");
    }
    std::this_thread::sleep_for(kStep);
  }
}

}  // namespace tileflight::app
