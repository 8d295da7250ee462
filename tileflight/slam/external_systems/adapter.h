#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace tileflight::external_systems {

/// An input that a system needs.
enum class Input { kImages, kStereo, kDepth, kImu, kLidar };

/// Returns the word of a manifest: "images", "stereo", "depth", "imu", "lidar".
std::string to_text(Input input);

/// Format in which a system writes its estimated trajectory.
struct PathConvention {
  std::string file = "trajectory.txt";  ///< relative to the folder of the system's output
  /// images.txt of COLMAP's text model instead of poses of TUM, EuRoC or KITTI, which are recognised by content
  bool is_colmap_model = false;
  bool camera_to_world = true;  ///< false: world to camera
  std::string of = "camera";    ///< whose pose: "camera", "imu" or "lidar"
  /// Time in the file's first column: "seconds", "nanoseconds" or "frame-indices" (always so in KITTI's format).
  std::string times = "seconds";
};

/// Description of a SLAM system, read from the manifest adapter.yaml of its folder (docs/systems.md). The system itself
/// is installed separately.
struct Adapter {
  std::filesystem::path folder;
  std::string name;   ///< letters, digits, '-' and '_'
  std::string title;  ///< "ORB-SLAM3"
  std::string homepage, licence;
  std::string tried;  ///< version and machine on which it was run; empty: never run

  std::vector<std::string> lenses;  ///< words of lens_name(); "any": all
  std::vector<Input> inputs;        ///< all of these are needed
  std::string layout;               ///< "tileflight", or a word of exports::export_layouts()
  bool needs_gpu = false;

  std::vector<std::string> programs;   ///< must be in PATH
  std::vector<std::string> variables;  ///< environment variables that name a file or folder, which must exist
  std::string version_command;         ///< prints the version; empty: none
  std::string command;                 ///< runs the system once; by the shell, in `folder`

  PathConvention path;
  std::string map;            ///< file of the map's points, relative to the output; empty: the system makes none
  bool metric_scale = false;  ///< the path is in metres
};

/// Reads FOLDER/adapter.yaml. Throws InputError (file, line, key).
Adapter read_adapter(const std::filesystem::path& folder);

/// Returns the adapter of an experiment's `odometry.command`: a shell command, run in `folder`, in which {dataset} and
/// {out} stand for the dataset and the folder where it leaves trajectory.txt (TUM, camera to world) and map.ply. It
/// reads the dataset as it is, with any lens.
Adapter command_adapter(std::string command, const std::filesystem::path& folder);

/// Returns the folders that hold adapters, those of the user first: the environment's TILEFLIGHT_ADAPTERS (separated by
/// ':'), `adapters` of the working directory, of the installed program and of its source tree.
std::vector<std::filesystem::path> adapter_folders();

/// Reads all adapters of adapter_folders(), by name; the first of a name counts. Throws InputError for a broken
/// manifest.
std::vector<Adapter> list_adapters();

/// Finds the adapter of a folder that holds adapter.yaml, relative to `base` (empty: the working directory), or else of
/// a name. Throws InputError that names the nearest known one.
Adapter find_adapter(const std::string& name_or_folder, const std::filesystem::path& base = {});

/// Returns why the system cannot run on this machine: "the program 'colmap' is not in PATH (apt-get install colmap)";
/// empty if nothing is missing.
std::string why_not_installed(const Adapter& adapter);

/// Throws InputError with the reason of why_not_installed(), if there is one.
void require_installed(const Adapter& adapter);

/// Returns the first line that version_command prints; empty if there is none or it fails.
std::string installed_version(const Adapter& adapter);

}  // namespace tileflight::external_systems
