#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace tileflight::scoring {

/// A scored map that an argument of `compare` names: metrics.json of its runs, the first run first.
struct FoundMap {
  std::string name;  ///< "stadium/real" of out/stadium/real, "stadium/dark/simulated" of the run's variant "dark"
  std::vector<std::filesystem::path> metrics_files{};
};

/// The maps that the arguments name, in their order. Each is a metrics.json, or a run folder, which stands for its
/// flights with all their runs and for those of its variants. Names are ends of paths, as long as it takes to tell all
/// maps apart; the same map named twice has a number. Throws InputError for a folder without a scored map.
std::vector<FoundMap> find_maps(const std::vector<std::filesystem::path>& arguments);

/// The maps whose names match one of the patterns (`*`, `?`, `[a-z]`; `*` matches slashes, too), in the order of the
/// patterns, then of the maps. Throws InputError for a pattern that matches none, naming the most similar name.
std::vector<FoundMap> choose_maps(const std::vector<FoundMap>& maps, const std::vector<std::string>& patterns);

/// The one map that `baseline` names: by a name or a pattern among `maps`, else as a path. Throws InputError if it is
/// none, or several.
FoundMap find_baseline(const std::vector<FoundMap>& maps, const std::string& baseline);

}  // namespace tileflight::scoring
