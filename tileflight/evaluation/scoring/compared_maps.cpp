#include "tileflight/evaluation/scoring/compared_maps.h"

#include <fnmatch.h>

#include <algorithm>
#include <map>

#include "tileflight/core/base/document_value.h"
#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"

namespace tileflight::scoring {
namespace fs = std::filesystem;
namespace {

/// metrics.json of a flight's first run, then of its further runs that did not fail.
std::vector<fs::path> list_metrics_files(const fs::path& flight) {
  std::vector<fs::path> files;
  if (fs::is_directory(flight / "runs")) {
    for (const fs::directory_entry& entry : fs::directory_iterator(flight / "runs")) {
      if (fs::exists(entry.path() / "metrics.json") && !fs::exists(entry.path() / "failed.txt"))
        files.push_back(entry.path() / "metrics.json");
    }
  }
  std::sort(files.begin(), files.end());
  files.insert(files.begin(), flight / "metrics.json");
  return files;
}

void add_flights(const fs::path& run, std::vector<FoundMap>& maps) {
  for (const char* flight : {"simulated", "real"})
    if (fs::exists(run / flight / "metrics.json")) maps.push_back({"", list_metrics_files(run / flight)});
}

/// The run's variants that were scored, by name.
void add_variants(const fs::path& run, std::vector<FoundMap>& maps) {
  if (!fs::is_directory(run / "variants")) return;
  std::vector<fs::path> variants;
  for (const fs::directory_entry& entry : fs::directory_iterator(run / "variants")) variants.push_back(entry.path());
  std::ranges::sort(variants);
  for (const fs::path& variant : variants) add_flights(variant, maps);
}

/// The folders that a map's name is made of, from the last: of out/stadium/variants/dark/simulated simulated, dark,
/// stadium, out. `least`: how many of them a name has anyway.
struct NameParts {
  std::vector<std::string> folders{};
  std::size_t least = 2;

  std::string name(std::size_t count) const {
    std::string text;
    for (std::size_t i = 0; i < std::min(std::max(count, least), folders.size()); ++i)
      text = folders[i] + (i == 0 ? "" : "/") + text;
    return text;
  }
};

NameParts name_parts(const fs::path& metrics_json) {
  NameParts parts;
  for (fs::path folder = fs::absolute(metrics_json).lexically_normal().parent_path(); folder.has_relative_path();
       folder = folder.parent_path()) {
    const std::string name = folder.filename().string();
    if (parts.folders.size() == 2 && name == "variants")
      parts.least = 3;  // the run's name, too
    else
      parts.folders.push_back(name);
  }
  return parts;
}

/// Gives each map the shortest name by which it differs from the others.
void name_maps(std::vector<FoundMap>& maps) {
  std::vector<NameParts> parts;
  for (const FoundMap& map : maps) parts.push_back(name_parts(map.metrics_files.front()));
  std::vector<std::size_t> counts(maps.size(), 0);
  for (bool longer = true; longer;) {
    std::map<std::string, std::vector<std::size_t>> same;
    for (std::size_t i = 0; i < maps.size(); ++i) same[parts[i].name(counts[i])].push_back(i);
    longer = false;
    for (const auto& [name, indices] : same) {
      for (const std::size_t i : indices) {
        maps[i].name = name;
        const std::size_t used = std::max(counts[i], parts[i].least);
        if (indices.size() == 1 || used >= parts[i].folders.size()) continue;
        counts[i] = used + 1;
        longer = true;
      }
    }
  }
}

fs::path file_of(const FoundMap& map) { return fs::weakly_canonical(map.metrics_files.front()); }

/// Names all maps. One that is given twice counts once, since nothing in its paths can differ; then it has a number.
void name_all(std::vector<FoundMap>& maps) {
  std::map<fs::path, std::size_t> places;  // in `once`
  std::vector<FoundMap> once;
  for (const FoundMap& map : maps)
    if (places.emplace(file_of(map), once.size()).second) once.push_back(map);
  name_maps(once);
  std::vector<std::size_t> seen(once.size(), 0);
  for (FoundMap& map : maps) {
    const std::size_t place = places.at(file_of(map));
    map.name = once[place].name;
    if (++seen[place] > 1) map.name += " #" + std::to_string(seen[place]);
  }
}

bool matches(const FoundMap& map, const std::string& pattern) {
  return map.name == pattern || fnmatch(pattern.c_str(), map.name.c_str(), 0) == 0;
}

std::vector<std::string> names_of(const std::vector<FoundMap>& maps) {
  std::vector<std::string> names;
  for (const FoundMap& map : maps) names.push_back(map.name);
  return names;
}

}  // namespace

std::vector<FoundMap> find_maps(const std::vector<fs::path>& arguments) {
  std::vector<FoundMap> maps;
  for (const fs::path& argument : arguments) {
    if (!fs::is_directory(argument)) {
      maps.push_back({"", {argument}});
      continue;
    }
    const std::size_t before = maps.size();
    if (fs::exists(argument / "metrics.json")) maps.push_back({"", {argument / "metrics.json"}});
    add_flights(argument, maps);
    add_variants(argument, maps);
    if (maps.size() == before)
      throw InputError(argument.string(), "contains no scored map; give a metrics.json or a folder written by `run`");
  }
  name_all(maps);
  return maps;
}

std::vector<FoundMap> choose_maps(const std::vector<FoundMap>& maps, const std::vector<std::string>& patterns) {
  std::vector<FoundMap> chosen;
  for (const std::string& pattern : patterns) {
    bool is_used = false;
    for (const FoundMap& map : maps) {
      if (!matches(map, pattern)) continue;
      is_used = true;
      if (std::ranges::find(chosen, map.name, &FoundMap::name) == chosen.end()) chosen.push_back(map);
    }
    if (!is_used)
      throw InputError("row '" + pattern + "'",
                       "matches none of the maps; did you mean '" + base::nearest_key(pattern, names_of(maps)) + "'?");
  }
  return chosen;
}

FoundMap find_baseline(const std::vector<FoundMap>& maps, const std::string& baseline) {
  std::vector<FoundMap> found;
  for (const FoundMap& map : maps)
    if (map.name == baseline) return map;
  for (const FoundMap& map : maps)
    if (matches(map, baseline)) found.push_back(map);
  if (found.empty()) {
    if (!fs::exists(baseline))
      throw InputError("baseline '" + baseline + "'", "is neither a map nor a file; did you mean '" +
                                                          base::nearest_key(baseline, names_of(maps)) + "'?");
    found = find_maps({baseline});
    for (FoundMap& map : found) {
      const auto same =
          std::ranges::find_if(maps, [&](const FoundMap& other) { return file_of(other) == file_of(map); });
      if (same != maps.end())
        map = *same;
      else if (std::ranges::find(maps, map.name, &FoundMap::name) != maps.end())
        map.name += " (baseline)";
    }
  }
  if (found.size() > 1)
    throw InputError("baseline '" + baseline + "'", "names " + std::to_string(found.size()) + " maps (" +
                                                        base::joined(names_of(found)) + "): name one");
  return found.front();
}

}  // namespace tileflight::scoring
