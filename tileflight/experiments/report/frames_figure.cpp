#include <algorithm>
#include <cmath>

#include "tileflight/core/drawing/number_format.h"
#include "tileflight/core/drawing/page_image.h"
#include "tileflight/experiments/report/figures.h"
#include "tileflight/experiments/report/frame_pairs.h"

namespace tileflight::report {
using drawing::element;
using drawing::format_fixed;
using drawing::Html;
using drawing::text;

namespace {

constexpr std::size_t kPairs = 3;
constexpr int kThumbnailPixels = 640;

std::string seconds_text(double time_s) { return format_fixed(time_s, 2) + " s"; }

/// `camera`: of a rig's other than the first; else empty.
Html frame_cell(const FlightRun& flight, const FrameFile& frame, const std::string& camera = "") {
  const std::string by = camera.empty() ? "" : ", camera " + camera;
  const std::string alt = flight.label + " flight" + by + ", image at " + seconds_text(frame.time_s);
  const Html image =
      drawing::empty_element("img", {{"src", drawing::thumbnail_uri(frame.image, kThumbnailPixels)}, {"alt", alt}});
  return element("div", {{"class", "frame " + flight.key}},
                 image + element("p", text(flight.label + by + ", " + seconds_text(frame.time_s))));
}

std::string pair_note(const FramePair& pair) {
  if (!pair.distance_m) return "";
  return "Cameras " + format_fixed(pair.distance_m, 1) + " m and " + format_fixed(pair.angle_deg, 0) + "\u00B0 apart.";
}

Html pairs_of(const FlightRun& first, const FlightRun& second, const std::vector<FramePair>& pairs) {
  Html rows;
  for (const FramePair& pair : pairs) {
    rows += element("div", {{"class", "pair"}},
                    frame_cell(first, pair.first) + frame_cell(second, pair.second) +
                        element("p", {{"class", "note"}}, text(pair_note(pair))));
  }
  return rows;
}

const FrameFile& nearest(const std::vector<FrameFile>& frames, double time_s) {
  return *std::ranges::min_element(frames, {},
                                   [time_s](const FrameFile& frame) { return std::abs(frame.time_s - time_s); });
}

/// Returns the images that the other cameras of a rig took at the times of `shown`, folded away for each camera.
Html other_cameras_of(const FlightRun& flight, const std::vector<FrameFile>& shown) {
  constexpr std::size_t kMostCameras = 8;
  Html all;
  const std::size_t count = std::min(kMostCameras, flight.other_cameras.size());
  for (std::size_t c = 0; c < count; ++c) {
    const CameraFrames& camera = flight.other_cameras[c];
    Html cells;
    for (const FrameFile& frame : shown) cells += frame_cell(flight, nearest(camera.frames, frame.time_s), camera.name);
    all += element("details", {{"class", "camera"}},
                   element("summary", text(flight.label + " flight, camera " + camera.name)) +
                       element("div", {{"class", "pair"}}, cells));
  }
  return all;
}

/// " Camera left; …" of a rig's flights.
std::string camera_note(const std::vector<const FlightRun*>& flights) {
  std::string note;
  for (const FlightRun* flight : flights) {
    if (flight->other_cameras.empty()) continue;
    note += " Those of the " + flight->label + " flight are camera " + flight->camera +
            "'s; unfold another camera for its images of the same moments.";
  }
  return note;
}

}  // namespace

drawing::Figure frames_figure(const RunFolder& run) {
  std::vector<const FlightRun*> flights;
  for (const FlightRun& flight : run.flights) {
    if (!flight.frames.empty()) flights.push_back(&flight);
  }
  if (flights.empty()) return {};
  if (flights.size() == 2) {
    const std::vector<FramePair> pairs = frame_pairs(*flights[0], *flights[1], kPairs);
    std::vector<FrameFile> first, second;
    for (const FramePair& pair : pairs) {
      first.push_back(pair.first);
      second.push_back(pair.second);
    }
    return {"frames", "frames",
            pairs_of(*flights[0], *flights[1], pairs) + other_cameras_of(*flights[0], first) +
                other_cameras_of(*flights[1], second),
            "Images of both flights with the most similar views." + camera_note(flights)};
  }
  const std::vector<FrameFile> shown = pick_evenly(flights[0]->frames, 2 * kPairs);
  Html cells;
  for (const FrameFile& frame : shown) cells += frame_cell(*flights[0], frame);
  return {"frames", "frames", element("div", {{"class", "pair"}}, cells) + other_cameras_of(*flights[0], shown),
          "Images of the " + flights[0]->label + " flight." + camera_note(flights)};
}

}  // namespace tileflight::report
