#pragma once
/// Phantom studies in memory or on disk:
///   HeadGeometry head = random_head(7);
///   Anatomy anatomy(head);
///   Protocol protocol = make_protocol("surface-coil", anatomy);
///   RenderedStack stack = render(anatomy, protocol, 0, 2);
///   Json true_values = truth(head);
#include "data_samples/phantom/acquisition.hpp"
#include "data_samples/phantom/anatomy.hpp"
#include "data_samples/phantom/geometry.hpp"
#include "data_samples/phantom/render.hpp"
#include "data_samples/phantom/study.hpp"
#include "data_samples/phantom/truth.hpp"
#include "data_samples/phantom/world.hpp"
