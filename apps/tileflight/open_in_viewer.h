#pragma once

#include <filesystem>

namespace tileflight::app {

/// Opens a file with the desktop's default program (xdg-open) without waiting for it. Throws InputError without a
/// desktop.
void open_in_viewer(const std::filesystem::path& file);

}  // namespace tileflight::app
