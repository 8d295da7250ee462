#include "tileflight/experiments/project/project.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <sstream>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/output_folder.h"
#include "tileflight/core/base/program.h"
#include "tileflight/core/imaging/image_files.h"
#include "tileflight/experiments/project/excerpt.h"
#include "tileflight/experiments/project/image_motion.h"
#include "tileflight/experiments/project/site.h"
#include "tileflight/slam/external_systems/adapter.h"
#include "tileflight/slam/odometry/image_examination.h"
#include "tileflight/tiles/demo_place/synthetic_place.h"
#include "tileflight/tiles/fetch/open_source.h"

namespace tileflight::project {
namespace {

namespace fs = std::filesystem;

/// Returns a text as YAML reads it back, whatever characters it holds. Throws InputError for one that is not UTF-8, as
/// YAML is.
std::string quoted(const std::string& text) {
  try {
    return nlohmann::json(text).dump();
  } catch (const nlohmann::json::type_error&) {
    const std::string shown = nlohmann::json(text).dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
    throw InputError(shown, "has a name that is not UTF-8, which an experiment cannot name: rename it");
  }
}

/// Returns a comment of one line; names of files may hold line breaks.
std::string comment(std::string text) {
  std::ranges::replace_if(
      text, [](char c) { return static_cast<unsigned char>(c) < ' '; }, ' ');
  return "# " + text + "\n";
}

/// Returns a file as the experiment names it: relative to the project if both are in one folder, else absolute.
std::string path_text(const fs::path& file, const fs::path& project) {
  const fs::path absolute = fs::absolute(file).lexically_normal();
  const fs::path base = fs::absolute(project).lexically_normal();
  const fs::path relative = absolute.lexically_relative(base);
  const auto ups = std::ranges::count(relative, fs::path(".."));
  return quoted(!relative.empty() && ups <= 1 ? relative.string() : absolute.string());
}

std::string source_text(const std::string& source, const fs::path& project) {
  if (fetch::is_network_source(source)) return quoted(fetch::redact_source(source));
  return path_text(source, project);
}

std::string video_text(const std::vector<fs::path>& parts, const fs::path& project) {
  if (parts.size() == 1) return path_text(parts.front(), project);
  std::vector<std::string> texts;
  for (const fs::path& part : parts) texts.push_back(path_text(part, project));
  return "[" + base::joined(texts) + "]";
}

void choose_step(const Recording& recording, const ImageFindings& images, Project& project) {
  const std::optional<FrameStep> step = choose_frame_step(images.motion, recording.frames_per_second, images.repeats);
  const int every = step ? step->every : 1;
  project.choices.push_back(
      {"real.ingest", "every", std::to_string(every),
       step
           ? base::formatted("%.3g frames a second: where it is fast, the image moves by %.2g %% of its width from one "
                             "to the next",
                             recording.frames_per_second / every, 100 * step->share) +
                 (images.repeats > 1 ? base::formatted("; each image is stored %d times", images.repeats) : "")
           : "corners cannot be followed from one image to the next, so every one is used",
       step ? Certainty::kLikely : Certainty::kGuess});
  if (recording.is_folder() && recording.photos.times.size() < recording.images.size())
    project.choices.push_back({"real.ingest", "fps", base::trimmed_text(recording.frames_per_second, 3),
                               "the images state no times; a wrong rate only makes the speeds wrong",
                               Certainty::kGuess});
}

/// The offset of a log's clock is found from motion, which images that stand still do not show.
void fix_offset_of_still_images(const ImageFindings& images, Project& project) {
  const auto offset = std::ranges::find(project.choices, "telemetry_offset", &Choice::key);
  if (!images.stands_still || offset == project.choices.end() || offset->value != "auto") return;
  *offset = {"real.ingest", "telemetry_offset", "0",
             "the log has a clock of its own, and its offset cannot be found from images that stand still: the log is "
             "taken to begin with the video",
             Certainty::kGuess};
}

/// `other_system`: title of the system that replaces the built-in odometry; empty: none.
void choose_mask(const ImageFindings& images, const fs::path& folder, const std::string& other_system,
                 Project& project) {
  if (images.mask.empty()) {
    project.choices.push_back(
        {"odometry", "mask", "", "no edges were found that stand still while the rest moves", Certainty::kLikely});
    return;
  }
  imaging::write_gray(folder / "mask.png", images.mask);
  const std::string reason =
      base::formatted("%.1f %% of the image stands still while the rest moves: on-screen text or parts of the vehicle",
                      100 * odometry::masked_share(images.mask));
  if (other_system.empty())
    project.choices.push_back({"odometry", "mask", quoted("mask.png"), reason, Certainty::kLikely});
  else
    project.choices.push_back(
        {"odometry", "mask", "", reason + "; " + other_system + " takes no mask", Certainty::kLikely});
}

void choose_shutter(const Recording& recording, const LensChoice& lens, Project& project) {
  const double line_delay_s = lens.calibration.line_delay_s;
  if (line_delay_s != 0.0) {
    project.choices.push_back({"odometry", "estimate_line_delay", "false",
                               base::formatted("camera.yaml has the rolling shutter's: %.1f ms from the first row to "
                                               "the last",
                                               1e3 * line_delay_s * recording.height),
                               lens.choice.certainty});
    return;
  }
  const bool is_video = !recording.is_folder();
  project.choices.push_back({"odometry", "estimate_line_delay", is_video ? "true" : "false",
                             is_video ? "the readout of the rolling shutter is not known"
                                      : "images of a folder may have any shutter; far apart, they do not show it",
                             Certainty::kLikely});
}

void choose_mode(const Recording& recording, Project& project) {
  const bool has_imu = std::ranges::any_of(recording.choices, [](const Choice& c) { return c.key == "imu"; });
  project.choices.push_back(
      {"odometry", "mode", "mono",
       has_imu ? "the positions give the scale; `inertial` uses the inertial unit as well" : "there is one camera",
       Certainty::kLikely});
}

/// Chooses the settings of the built-in odometry, or another system in its place, which has settings of its own.
void choose_odometry(const ProjectOptions& options, const std::optional<external_systems::Adapter>& system,
                     const fs::path& folder, const Recording& recording, const LensChoice& lens, Project& project) {
  if (!system) {
    choose_shutter(recording, lens, project);
    choose_mode(recording, project);
    return;
  }
  const bool is_folder = fs::exists(fs::path(options.system) / "adapter.yaml");
  project.choices.push_back(
      {"odometry", "system", is_folder ? path_text(system->folder, folder) : quoted(options.system), "it was given"});
  if (const std::string missing = external_systems::why_not_installed(*system); !missing.empty())
    project.warnings.push_back(system->title + " is not installed here: " + missing);
}

/// Returns the heights above take-off that a log on the video's clock states; empty if it does not state them
/// throughout.
std::vector<TrackSample> track_above_takeoff(const Recording& recording) {
  std::vector<TrackSample> track;
  if (!recording.has_video_clock) return track;
  for (const flight_logs::TelemetryFix& fix : recording.telemetry.fixes) {
    if (!fix.height_above_takeoff_m) return {};
    track.push_back({fix.time_s, *fix.height_above_takeoff_m, true});
  }
  return track;
}

/// Returns the part of the recording in which a lens can be followed from image to image.
Excerpt unbroken_part(const Recording& recording, const ImageFindings& images) {
  Excerpt whole{.from_s = recording.from_s, .to_s = {}, .choices = {}};
  if (recording.to_s < recording.duration_s) whole.to_s = recording.to_s;
  return leave_out_breaks(std::move(whole), images.breaks, recording.duration_s);
}

/// Adds the part of the recording and what depends on the place.
void choose_place(const ProjectOptions& options, const Recording& recording, const ImageFindings& images,
                  const imaging::Camera& camera, const fs::path& temporary, const fs::path& folder, Project& project,
                  const Progress& progress) {
  const auto with_given = [&](Excerpt chosen) {
    chosen = with_given_ends(std::move(chosen), options.files.from_s, options.files.to_s);
    chosen = leave_out_breaks(std::move(chosen), images.breaks, recording.duration_s);
    return with_given_ends(std::move(chosen), options.files.from_s, options.files.to_s);
  };
  const auto append = [&](const std::vector<Choice>& choices) {
    project.choices.insert(project.choices.end(), choices.begin(), choices.end());
  };
  if (options.place.empty()) {
    if (recording.has_positions()) append(choose_height_reference(recording));
    const std::vector<TrackSample> track = track_above_takeoff(recording);
    append(with_given(track.empty() ? choose_excerpt_by_motion(images.motion, recording.duration_s)
                                    : choose_excerpt(track, false, recording.duration_s))
               .choices);
    project.warnings.emplace_back(
        "no place is given (--place): the map's error cannot be known, and the path is compared with the recorded "
        "positions only, if there are any");
    return;
  }
  project.choices.insert(project.choices.begin(),
                         {"place", "source", source_text(options.place, folder), "it was given"});
  Site site = choose_site({.source = options.place,
                           .origin = options.origin,
                           .source_options = options.source_options,
                           .choose_excerpt =
                               [&](const std::vector<TrackSample>& track, bool above_ground) {
                                 return with_given(choose_excerpt(track, above_ground, recording.duration_s));
                               }},
                          recording, camera, progress);
  append(site.choices);
  append(site.excerpt ? site.excerpt->choices
                      : with_given(choose_excerpt_by_motion(images.motion, recording.duration_s)).choices);
  base::add_distinct(site.warnings, project.warnings);
  imaging::write_rgb(temporary / "map.png", site.map);
  project.choices.push_back({"simulated.render", "follow", "real",
                             "the simulated flight follows the path that was found, with the same lens"});
}

/// Writes one section and those in it, "real.ingest" below "real".
class ExperimentText {
 public:
  void add(const Choice& choice) {
    const std::size_t dot = choice.section.find('.');
    const std::string outer = choice.section.substr(0, dot);
    Section& section = find(outer);
    section.inner = dot == std::string::npos ? "" : choice.section.substr(dot + 1);
    section.choices.push_back(&choice);
  }

  std::string text() const {
    std::ostringstream out;
    for (const Section& section : sections_) {
      out << "\n" << section.name << ":\n";
      if (!section.inner.empty()) out << "  " << section.inner << ":\n";
      const std::string indent(section.inner.empty() ? 2 : 4, ' ');
      for (const Choice* choice : section.choices) {
        const std::string why = choice->reason + " (" + to_string(choice->certainty) + ")";
        if (choice->value.empty()) {
          out << indent << comment(choice->key + ": " + why);
        } else {
          out << indent << comment(why) << indent << choice->key << ": " << choice->value << "\n";
        }
      }
    }
    return out.str();
  }

 private:
  struct Section {
    std::string name, inner;
    std::vector<const Choice*> choices;
  };

  Section& find(const std::string& name) {
    const auto found = std::ranges::find(sections_, name, &Section::name);
    if (found != sections_.end()) return *found;
    sections_.push_back({name, "", {}});
    return sections_.back();
  }

  std::vector<Section> sections_;
};

std::string experiment_text(const Project& project, const std::string& name) {
  ExperimentText sections;
  for (const char* order : {"place", "truth", "real", "simulated", "odometry"})
    for (const Choice& choice : project.choices)
      if (choice.section == order || choice.section.starts_with(std::string(order) + ".")) sections.add(choice);
  std::string head =
      "# Made by `tileflight new` (" + base::version() +
      ") from what the recording says. Each line has its reason, and how sure it is. Change\n# what is wrong, then:\n"
      "#   tileflight run experiment.yaml --out results\n";
  for (const std::string& warning : project.warnings) head += comment("Note: " + warning);
  return head + "name: " + quoted(name) + "\nseed: 1\n" + sections.text();
}

void write_camera(const fs::path& file, const imaging::Calibration& calibration, const Choice& choice) {
  imaging::write_kalibr(file, calibration);
  base::write_file(file, comment(choice.reason + " (" + to_string(choice.certainty) + ")") + base::read_text(file));
}

}  // namespace

Project make_project(const ProjectOptions& options, const fs::path& folder, bool replace, const Progress& progress) {
  base::OutputFolder output{.folder = folder, .command = "new", .replace = replace, .inputs = options.files.videos};
  if (!options.place.empty() && !fetch::is_network_source(options.place)) output.inputs.emplace_back(options.place);
  base::require_writable(output);
  if (demo_place::built_in_source(options.place))
    throw InputError(options.place, "is built in and not written yet: `tileflight scene " +
                                        options.place.substr(0, options.place.find_first_of("-:")) +
                                        " DIR` writes it; give DIR/twin or DIR/world");
  std::optional<external_systems::Adapter> system;
  if (!options.system.empty()) system = external_systems::find_adapter(options.system);
  Project project;
  Recording recording = examine_files(options.files);
  base::add_distinct(recording.warnings, project.warnings);
  base::add_distinct(recording.telemetry.warnings, project.warnings);
  for (Choice& choice : recording.choices) {
    if (choice.key == "video") choice.value = video_text(recording.parts, folder);
    if ((choice.key == "telemetry" || choice.key == "imu") && !choice.value.empty())
      choice.value = path_text(choice.value, folder);
  }
  project.choices = recording.choices;
  LensChoice lens = choose_lens(recording, options.lens, progress);
  const ImageFindings images = examine_images(recording, progress);
  base::add_distinct(images.warnings, project.warnings);
  fix_offset_of_still_images(images, project);
  base::write_folder(output, [&](const fs::path& temporary) {
    choose_mask(images, temporary, system ? system->title : "", project);
    if (lens.guess)
      estimate_from_images(recording, unbroken_part(recording, images),
                           images.mask.empty() ? fs::path() : temporary / "mask.png", lens, progress);
    base::add_distinct(lens.warnings, project.warnings);
    lens.choice.value = quoted("camera.yaml");
    project.choices.push_back(lens.choice);
    choose_step(recording, images, project);
    choose_odometry(options, system, folder, recording, lens, project);
    choose_place(options, recording, images, lens.calibration.camera, temporary, folder, project, progress);
    write_camera(temporary / "camera.yaml", lens.calibration, lens.choice);
    base::write_file(temporary / "experiment.yaml", experiment_text(project, recording.parts.front().stem().string()));
  });
  project.experiment = folder / "experiment.yaml";
  return project;
}

nlohmann::json to_json(const Project& project) {
  nlohmann::json choices = nlohmann::json::array();
  for (const Choice& choice : project.choices)
    choices.push_back({{"section", choice.section},
                       {"key", choice.key},
                       {"value", choice.value},
                       {"reason", choice.reason},
                       {"certainty", to_string(choice.certainty)}});
  return {{"experiment", project.experiment.string()}, {"choices", choices}, {"warnings", project.warnings}};
}

}  // namespace tileflight::project
