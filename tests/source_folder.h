#pragma once

#include <filesystem>

namespace tileflight::tests {

/// The repository's folder. It is compiled into one small file alone, so that the tests of all clones are the same text
/// to a compiler cache.
std::filesystem::path source_folder();

}  // namespace tileflight::tests
