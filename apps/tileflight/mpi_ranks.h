#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <nlohmann/json_fwd.hpp>

#include "tileflight/core/jobs/ranks.h"

namespace tileflight::app {

/// The processes that mpirun started together with this one, or null. MPI is initialized only in the former case, and
/// finalized by the object's destructor. Throws InputError in a build without MPI.
std::unique_ptr<jobs::Ranks> ranks_of_mpirun();

/// Runs `work` with the processes of mpirun, or with null where there are none. A failure known to all is thrown by the
/// first process, by the others as FailedElsewhere; one that only a single process knows of is printed and terminates
/// all.
nlohmann::json run_among_ranks(const std::function<nlohmann::json(jobs::Ranks*)>& work);

/// Ends a process that failed together with the first one, which reports the failure. mpirun ends all processes as soon
/// as one has failed, also the first before it has said why; so this one waits for that, at most 5 s.
[[noreturn]] void let_first_rank_report();

/// Throws InputError in the first of several processes of mpirun; the others wait for mpirun to end them. For a command
/// that does not share its work: each process would do all of it, and write to the same files.
void refuse_ranks();

/// Terminates all processes of mpirun, for a failure that only this one knows of.
[[noreturn]] void abort_ranks();

/// Number of processes that mpirun runs on this machine; 1 without mpirun.
int ranks_on_this_machine();

/// Default number of threads: the machine's cores divided among the processes that mpirun runs on it, at most the
/// number available to this process.
std::size_t threads_by_default();

}  // namespace tileflight::app
