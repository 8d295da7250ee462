#pragma once

#include <cstddef>
#include <memory>

#include "tileflight/experiment/ranks.h"

namespace tileflight::app {

/// The processes that mpirun started with this one; null where none did. Only then MPI is initialised, and finalised
/// with the object. Throws InputError in a build without MPI.
std::unique_ptr<experiment::Ranks> ranks_of_mpirun();

/// Ends all processes of mpirun at once, for a failure that only this one knows.
[[noreturn]] void abort_ranks();

/// Threads for this process: the machine's cores shared among the processes that mpirun runs on it, and no more than it
/// may use.
std::size_t threads_by_default();

}  // namespace tileflight::app
