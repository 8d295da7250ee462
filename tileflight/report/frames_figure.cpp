#include "tileflight/report/figures.h"
#include "tileflight/report/frame_pairs.h"
#include "tileflight/report/number_format.h"

namespace tileflight::report {
namespace {

constexpr std::size_t kPairs = 3;
constexpr int kThumbnailPixels = 640;

std::string seconds_text(double time_s) { return format_fixed(time_s, 2) + " s"; }

Html frame_cell(const FlightRun& flight, const FrameFile& frame) {
  const std::string alt = flight.label + " flight, image at " + seconds_text(frame.time_s);
  const Html image = empty_element("img", {{"src", thumbnail_uri(frame.image, kThumbnailPixels)}, {"alt", alt}});
  return element("div", {{"class", "frame " + flight.key}},
                 image + element("p", text(flight.label + ", " + seconds_text(frame.time_s))));
}

std::string pair_note(const FramePair& pair) {
  if (!pair.distance_m) return "";
  return "Cameras " + format_fixed(pair.distance_m, 1) + " m and " + format_fixed(pair.angle_deg, 0) + "\u00B0 apart.";
}

Html pairs_of(const FlightRun& first, const FlightRun& second) {
  Html rows;
  for (const FramePair& pair : frame_pairs(first, second, kPairs)) {
    rows += element("div", {{"class", "pair"}},
                    frame_cell(first, pair.first) + frame_cell(second, pair.second) +
                        element("p", {{"class", "note"}}, text(pair_note(pair))));
  }
  return rows;
}

}  // namespace

Figure frames_figure(const RunFolder& run) {
  std::vector<const FlightRun*> flights;
  for (const FlightRun& flight : run.flights) {
    if (!flight.frames.empty()) flights.push_back(&flight);
  }
  if (flights.empty()) return {};
  if (flights.size() == 2) {
    return {"frames", "frames", pairs_of(*flights[0], *flights[1]),
            "Images of both flights with the most similar views."};
  }
  Html cells;
  for (const FrameFile& frame : pick_evenly(flights[0]->frames, 2 * kPairs)) cells += frame_cell(*flights[0], frame);
  return {"frames", "frames", element("div", {{"class", "pair"}}, cells),
          "Images of the " + flights[0]->label + " flight."};
}

}  // namespace tileflight::report
