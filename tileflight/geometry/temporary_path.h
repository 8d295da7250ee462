#pragma once

#include <filesystem>

namespace tileflight::geometry {

/// A name beside `target` that nothing has yet, for what is renamed to `target` when it is whole:
/// ".NAME.PID-N.tmp". Removes what processes of this machine that no longer run have left there under such names: a
/// killed run can clear nothing away itself.
std::filesystem::path temporary_beside(const std::filesystem::path& target);

}  // namespace tileflight::geometry
