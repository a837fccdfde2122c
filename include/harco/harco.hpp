// All of HArCo. See the single headers for what they offer.
#pragma once

#include "harco/camera.hpp"
#include "harco/code.hpp"
#include "harco/detect.hpp"
#include "harco/dictionary.hpp"
#include "harco/draw.hpp"
#include "harco/error.hpp"
#include "harco/geometry.hpp"
#include "harco/image.hpp"
#include "harco/layout.hpp"
#include "harco/marker.hpp"
#include "harco/mount.hpp"
#include "harco/plan.hpp"
#include "harco/pose.hpp"
#include "harco/track.hpp"
#include "harco/version.hpp"
#include "harco/view_range.hpp"
