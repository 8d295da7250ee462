#pragma once

#include <filesystem>

namespace tileflight::geometry {

/// A name beside `target` that nothing has yet, for what is renamed to `target` when it is whole:
/// ".NAME.PID-N.tmp". Removes what processes of this machine that no longer run have left there under such names: a
/// killed run can clear nothing away itself.
std::filesystem::path temporary_beside(const std::filesystem::path& target);

/// Whether a file goes by the name of a temporary one whose process no longer runs.
bool is_abandoned_temporary(const std::filesystem::path& file_name);

/// A name beside `target` for what is there now, while something else takes its place: ".NAME.PID-N.old".
std::filesystem::path moved_aside_beside(const std::filesystem::path& target);

/// Where a process was killed after it had moved `target` aside, and before something else was in its place, it is put
/// back; where that was there, what was moved aside is removed.
void put_back_moved(const std::filesystem::path& target);

}  // namespace tileflight::geometry
