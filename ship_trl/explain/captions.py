"""What stands below each figure: how it is read, and what it must be judged beside."""

PROBES = (
    "Ridge regression on what a layer gives, judged on held-out episodes; bars are 95 % intervals of the "
    "explained network. A layer has features of its own only where its line is above both the dashed line "
    "(raw pixels) and the dotted ones (untrained networks). First layers pass on nearly the whole "
    "picture, so that reading well from them needs no training; the last ones have room for little, and "
    "what is kept there was chosen. A bearing is the angle off the bow, read as sine and cosine."
)
CHANGE = (
    "Debiased linear CKA on held-out states, with 95 % intervals (jackknife over episodes). Copied layers "
    "start at 1 with the source by construction. A layer that training left as it was stays at 1 with "
    "itself before; one below the band of other seeds changed by more than two seeds differ. The dotted "
    "line is what architecture and picture alone make alike."
)
MATRIX = "Debiased linear CKA of all pairs on held-out states. Dark is unrelated, light is alike."
ERASED = (
    "The picture is drawn again without the thing. Left: how often the network then chooses another "
    "action, with 95 % intervals over episodes. Middle: how far the advantages of all actions move, 1 "
    "being how much they vary from state to state; it judges untrained networks more fairly, for one that "
    "chooses the same action everywhere can never choose another. Right: the mean gradient on the thing's "
    "pixels, 1 (dashed) being that of the whole picture. A picture without the line never occurs in "
    "training, so what a network makes of it is a guess."
)
SALIENCY = (
    "States at a sixth, a half and five sixths of the greedy episode. Gradient: how strongly the chosen "
    "action's advantage answers to each pixel; one that looks like that of an untrained network shows the "
    "picture's edges and not what was learned. Occlusion: how far the advantage falls when a square of 7 "
    "x 7 pixels around the place shows the sea alone; orange speaks for the action, blue against it; "
    "where nothing is drawn it is zero by construction."
)
FILTERS = (
    "Each square is a filter of conv1, 8 x 8 pixels in the paper's network. All panels have one scale. "
    "Filters that look like those of an untrained network were hardly changed by training, and can serve "
    "all the same."
)
MAPS = (
    "The picture of the middle state above, and what the layers give for it, after ReLU: of conv layers "
    "the 16 maps that vary most over all states, each scaled by its own largest value; of linear layers "
    "every unit."
)
STATES = (
    "Half of the episodes take random actions, half those of the explained network with a quarter of "
    "random ones, from anywhere around the way to the goal (shifted by up to 300 m, turned by up to 90 "
    "degrees) and at any time, so that bearings and distances do not follow from one another. Fitted and "
    "held-out states are of different episodes."
)
