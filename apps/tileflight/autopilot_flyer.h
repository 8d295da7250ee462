#pragma once

#include "tileflight/survey/render_stage.h"

namespace tileflight::app {

/// Flies the autopilots of FLIGHT files in this program's simulator; empty in a program without one.
survey::AutopilotFlyer autopilot_flyer();

}  // namespace tileflight::app
