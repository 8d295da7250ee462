#include "tileflight/experiments/experiment/run_folder.h"

#include <algorithm>
#include <array>
#include <string_view>
#include <system_error>
#include <vector>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/output_folder.h"

namespace tileflight::experiment {
namespace fs = std::filesystem;
namespace {

/// Files written by runs besides folders with their own marker; a prefix "FOLDER/" restricts them to folders of that
/// name.
constexpr std::array kRunFiles{".lock",
                               ".file-hashes",
                               ".tileflight",
                               "stages/*.json",
                               "results.json",
                               "report.html",
                               "report.json",
                               "figures/*.svg",
                               "figures/*.csv",
                               "tables/*.csv",
                               "tables/*.tex",
                               "transform.json",
                               "metrics.json",
                               "errors.ply",
                               "seen.ply",
                               "failed.txt",
                               "comparison.json",
                               "failure.json",
                               "reproduction.json",
                               "reproduction.csv",
                               "lost-frames.csv",
                               "missed-places.csv",
                               "ablation.csv",
                               "moving.ply",
                               "ingest.json",
                               "trajectory-errors.json"};

/// Runs of earlier versions have no marker.
bool has_stage_records(const fs::path& folder) {
  const fs::path stages = folder / "stages";
  return fs::is_directory(stages) &&
         std::all_of(fs::directory_iterator(stages), fs::directory_iterator(),
                     [](const fs::directory_entry& entry) { return entry.path().extension() == ".json"; });
}

bool is_run(const fs::path& folder) {
  const auto marker = base::read_folder_marker(folder);
  return marker ? marker->command == "run" : has_stage_records(folder);
}

/// Tells whether the folder holds nothing but the project that `run VIDEO` makes in it.
bool is_unused(const fs::path& folder) {
  const auto is_project = [](const fs::path& path) {
    const auto marker = base::read_folder_marker(path);
    return marker && marker->command == "new";
  };
  return std::all_of(fs::directory_iterator(folder), fs::directory_iterator(), [&](const fs::directory_entry& entry) {
    return entry.path().filename() == jobs::FolderLock::kFile || is_project(entry.path());
  });
}

/// Marks the folder as a run's. It lists no files: stages come and go, each with its own marker.
void write_marker(const fs::path& folder) {
  if (base::read_folder_marker(folder)) return;
  base::write_file(folder / base::kFolderMarker,
                   "tileflight run\n# Stages of this run; stages whose inputs change are run again.\n");
}

bool is_run_file(const fs::path& file) {
  const std::string name = file.filename().string();
  const std::string with_folder = file.parent_path().filename().string() + "/" + name;
  return std::any_of(kRunFiles.begin(), kRunFiles.end(), [&](std::string_view pattern) {
    return base::matches_pattern(pattern.find('/') == std::string_view::npos ? name : with_folder, pattern);
  });
}

bool is_frame_store(const fs::path& folder) {
  const std::string name = folder.filename().string();
  return name.starts_with('.') && name.ends_with(".frames");
}

/// Whether a folder was written by a stage and holds no other files.
bool is_stage_folder(const fs::path& folder) {
  const auto marker = base::read_folder_marker(folder);
  return marker && marker->command != "run" && !base::find_foreign_file(folder);
}

}  // namespace

void check_run_folder(const fs::path& folder) {
  if (!fs::exists(folder)) return;
  if (!fs::is_directory(folder)) throw InputError(folder.string(), "is a file; choose a folder for --out");
  if (is_run(folder) || is_unused(folder)) return;
  throw InputError(folder.string(), "contains files that are not from an earlier run; choose another folder for --out");
}

RunFolder::RunFolder(fs::path folder) : path_(std::move(folder)) {
  check_run_folder(path_);
  base::make_folder(path_);
  lock_.emplace(path_);
  write_marker(path_);
  base::make_folder(path_ / "stages");
}

void remove_results(const fs::path& part) {
  std::error_code error;
  std::vector<fs::directory_entry> entries;
  for (fs::directory_iterator entry(part, error), end; !error && entry != end; entry.increment(error))
    entries.push_back(*entry);
  for (const fs::directory_entry& entry : entries) {
    const fs::path& path = entry.path();
    if (!fs::is_directory(entry.symlink_status(error))) {
      if (is_run_file(path)) fs::remove(path, error);
    } else if (is_frame_store(path) || is_stage_folder(path)) {
      fs::remove_all(path, error);
    } else if (!base::read_folder_marker(path) || is_run(path)) {
      remove_results(path);
    }
  }
  fs::remove(part, error);  // only if it is empty
}

}  // namespace tileflight::experiment
