#pragma once

#include <cstdint>
#include <filesystem>
#include <nlohmann/json_fwd.hpp>

#include "tileflight/core/base/progress.h"
#include "tileflight/core/jobs/process.h"
#include "tileflight/slam/external_systems/adapter.h"

namespace tileflight::external_systems {

/// Settings of run_system().
struct SystemRunOptions {
  std::uint64_t seed = 1;  ///< given to the adapter; some systems ignore it
  int threads = 0;         ///< number that the system may use; 0: one per core
  jobs::ProcessLimits limits;
  std::filesystem::path program;  ///< this program, for adapters that call it; empty: the running one
  bool replace = false;
};

/// Runs a system once on a dataset and writes the folder `out` as odometry writes its own: trajectory.txt, map.ply (if
/// the system makes one), camera.yaml (of the images as handed over), system.log (what it printed) and odometry.json,
/// which is returned. Its key `system` holds {name, title, version, applicable, completed, reason, seconds,
/// cpu_seconds, peak_memory_mb, exit_status, seed, threads, limits, lens, handed_lens, visible_share, layout, scale,
/// notes}. A system that is not installed, not applicable (it lacks an input, or its layout cannot hold the dataset),
/// fails or leaves what cannot be read is a result: `completed` is false, and `reason` says why. Only the system's own
/// process is measured, not the preparation of its input. Throws InputError for an unreadable dataset and a folder that
/// cannot be written.
nlohmann::json run_system(const Adapter& adapter, const std::filesystem::path& dataset,
                          const std::filesystem::path& out, const SystemRunOptions& options,
                          const Progress& progress = {});

}  // namespace tileflight::external_systems
