#pragma once

#include <filesystem>

namespace tileflight::app {

/// Opens a file with the program that the user's desktop has for it (xdg-open), and does not wait until that is closed.
/// Throws InputError where there is no desktop to do it.
void open_in_viewer(const std::filesystem::path& file);

}  // namespace tileflight::app
